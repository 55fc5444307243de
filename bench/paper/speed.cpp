// Build times of fields: Tables 2 to 5.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <functional>
#include <glm/geometric.hpp>
#include <stdexcept>

#include <bilayer/cl/filler.h>
#include "bench/builders.h"
#include "bench/measure.h"
#include "bench/paper/markdown.h"
#include "bench/paper/models.h"
#include "bench/paper/part.h"
#include "bench/paper/published.h"
#include "bench/paper/scatter.h"

namespace bilayer::paper {
namespace {

using bench::Builder;
using bench::Scene;
using bench::Stopwatch;
using nlohmann::json;
using published::tableNodes;

constexpr float halfWidth = 2;     // "about 2 Delta away from the triangle mesh", for all builders [steps]
constexpr int threads = 2;         // of builders with more than one thread, except devices
constexpr double maxSeconds = 25;  // a builder gets no further turns once it has used this time
constexpr double MiB = 1 << 20;

// A timed alternative; alternatives run in turns.
struct Contender {
    std::string name;
    std::function<void()> work;
    std::vector<double> seconds{};
};

// Contenders take turns, so that a slow minute affects all of them alike. The first round counts, since a mesh is built
// only once.
json medians(std::vector<Contender> contenders, int rounds) {
    for (int round = 0; round < rounds; ++round)
        for (Contender& contender : contenders) {
            double spent = 0;
            for (const double s : contender.seconds) spent += s;
            if (spent > maxSeconds) continue;
            const Stopwatch watch;
            contender.work();
            contender.seconds.push_back(watch.seconds());
        }
    json result;
    for (const Contender& contender : contenders) result[contender.name] = bench::median(contender.seconds);
    return result;
}

Contender builder(const std::string& name, const Scene& scene, const bench::Job& job) {
    return {name, [&scene, job] { bench::run(scene, job); }};
}

Contender dense(const std::string& name, const Scene& scene, const Lattice& lattice, const DenseOptions& options = {}) {
    return {name, [&scene, lattice, options] { denseDoubleLayer(scene.mesh, lattice, options); }};
}

double value(const json& row, const char* name) {
    return row.contains(name) && row[name].is_number() ? row[name].get<double>() : std::nan("");
}

// An OpenCL device and its builder.
struct Engine {
    Device device;
    DeviceInfo info;
    BlockFiller filler;
};

std::vector<Engine> engines() {
    std::vector<Engine> all;
    for (const DeviceInfo& info : devices()) {
        const Device device = openDevice(info.name);
        all.push_back({device, device.info(), openclFiller(device)});
    }
    return all;
}

// By the device's clock, as the paper measured: seconds of the kernels, and the peak of device memory.
json profiled(const Engine& engine, const Scene& scene, Builder builder, int rounds) {
    std::vector<double> kernels;
    std::uint64_t peak = 0;
    for (int round = 0; round < rounds; ++round) {
        const OpenclFiller filler = openclFiller(engine.device, {.profile = true});
        bench::run(scene, {builder, halfWidth, threads, &filler});
        kernels.push_back(filler.times().kernels);
        peak = std::max(peak, filler.times().peakBytes);
    }
    return {{"kernels", bench::median(kernels)}, {"peak", peak}};
}

// Times of a device for some builders: a warm-up, which compiles; the turns; and the device's own clock.
json onDevice(const Engine& engine, const Scene& scene, const std::vector<Builder>& builders, int rounds) {
    std::vector<Contender> contenders;
    for (const Builder which : builders) {
        const bench::Job job{which, halfWidth, threads, &engine.filler};
        bench::run(scene, job);
        contenders.push_back(builder(bench::nameOf(which), scene, job));
    }
    json result{{"device", engine.info.name},
                {"gpu", engine.info.gpu},
                {"units", engine.info.computeUnits},
                {"whole", medians(contenders, rounds)}};
    for (const Builder which : builders) result["clock"][bench::nameOf(which)] = profiled(engine, scene, which, rounds);
    return result;
}

// Name of a device with its count of compute units.
std::string nameOf(const json& device) {
    const int units = device.value("units", 0);
    return device["device"].get<std::string>() + (units ? fmt::format(" ({} compute units)", units) : "");
}

// Legend for the column names "OpenCL 1" and so on.
std::string legend(const json& devices) {
    std::string text;
    for (std::size_t i = 0; i < devices.size(); ++i) text += fmt::format(" OpenCL {}: {}.", i + 1, nameOf(devices[i]));
    return text.empty() ? " No OpenCL device." : text;
}

json measureTable2(const Run& run) {
    json rows = json::array();
    const Lattice lattice = latticeOf(tableNodes);
    for (const published::Seconds& paper : published::tables23) {
        auto model = findModel(paper.model, run.meshes);
        if (!model) continue;
        const Scene scene{model->name, float(tableNodes), fitted(std::move(model->mesh), lattice), lattice.step};
        std::vector<Contender> contenders{
            {"awpn", [&] { scatterPseudonormal(scene.mesh, lattice, halfWidth); }},
            dense("plain", scene, lattice, {.shareRows = false}),
            dense("dense", scene, lattice),
            dense("recursive", scene, lattice, {.subdivision = Subdivision::recursive}),
        };
        for (const int count : {1, threads}) {
            const auto add = [&](const char* name, Builder which) {
                contenders.push_back(builder(fmt::format("{} {}", name, count), scene, {which, halfWidth, count}));
            };
            add("layers", Builder::doubleLayer);
            add("exact", Builder::exact);
            add("pseudonormal", Builder::pseudonormal);
            add("openvdb", Builder::reference);
        }
        json row = medians(contenders, run.rounds);
        row["model"] = model->name;
        row["origin"] = model->origin;
        row["triangles"] = scene.mesh.triangles.size();
        row["samples"] = denseDoubleLayer(scene.mesh, lattice).samples;
        row["recursiveSamples"] =
            denseDoubleLayer(scene.mesh, lattice, {.subdivision = Subdivision::recursive}).samples;
        rows.push_back(row);
    }
    return {{"rows", rows}};
}

const published::Seconds& published23(const std::string& model) {
    for (const published::Seconds& paper : published::tables23)
        if (model == paper.model) return paper;
    throw std::logic_error("not in the paper: " + model);
}

std::string remarksTable2(const std::vector<double>& gains, const std::vector<double>& byRows,
                          const std::vector<double>& byRecursion, const std::vector<double>& awpn,
                          const std::vector<double>& serial, const std::vector<std::string>& more) {
    const double gain = bench::geometricMean(gains);
    return fmt::format(
               "\nAWPN takes {:.1f} times as long as in the paper, the dense program, plain, {:.1f} times, in the "
               "geometric mean: these are plain programs on another processor, and the paper calls its AWPN \"totally "
               "optimised\". On one thread the block-wise double layer is {:.1f} times as fast as the dense program{}. "
               "With the rows of section 4.2 the dense program takes {:.2f} of its time without{}. With the recursive "
               "subdivision it takes {:.2f} of its time with Algorithm 1, which the paper finds the faster one",
               bench::geometricMean(awpn), bench::geometricMean(serial), gain,
               gain > 1 ? ": no grid of the whole box is cleared and read, a block stays in cache, and a vector of "
                          "samples or voxels goes at once"
                        : "",
               bench::geometricMean(byRows),
               bench::geometricMean(byRows) > 0.95 ? ", where the paper gains much: today's compilers take what is the "
                                                     "same along a row out of the loop "
                                                     "by themselves"
                                                   : "",
               bench::geometricMean(byRecursion)) +
           (more.empty() ? ".\n"
                         : fmt::format("; it rounds the number of rows up and takes more samples of: {}.\n",
                                       fmt::join(more, ", ")));
}

std::string textTable2(const json& data) {
    std::vector<std::vector<std::string>> rivals, ours;
    std::string origins;
    std::vector<double> gains, byRows, byRecursion, awpn, serial;
    std::vector<std::string> more;
    for (const json& row : data["rows"]) {
        const std::string model = row["model"];
        const published::Seconds& paper = published23(model);
        rivals.push_back(
            {model, fmt::format("{} / {:.2f}", paper.triangles, row["triangles"].get<double>() / published::thousand),
             printed(paper.awpn), seconds(value(row, "awpn")), printed(paper.serial), seconds(value(row, "plain")),
             seconds(value(row, "dense")), seconds(value(row, "recursive")),
             fmt::format("{} / {}", row["samples"].get<std::uint64_t>(),
                         row["recursiveSamples"].get<std::uint64_t>())});
        ours.push_back({model, seconds(value(row, "dense"))});
        for (const char* name : {"layers 1", "layers 2", "exact 1", "exact 2", "pseudonormal 1", "pseudonormal 2",
                                 "openvdb 1", "openvdb 2"})
            ours.back().push_back(seconds(value(row, name)));
        gains.push_back(value(row, "dense") / value(row, "layers 1"));
        byRows.push_back(value(row, "dense") / value(row, "plain"));
        byRecursion.push_back(value(row, "recursive") / value(row, "dense"));
        awpn.push_back(value(row, "awpn") / paper.awpn);
        serial.push_back(value(row, "plain") / paper.serial);
        if (row["samples"] > row["recursiveSamples"]) more.push_back(model);
        origins += fmt::format("{}{}: {}", origins.empty() ? "" : "; ", model, row["origin"].get<std::string>());
    }
    return fmt::format(
               "Seconds at 251^3, one thread. *Dense*: the paper's program, without and with the rows of section 4.2, "
               "and with the recursive subdivision; *AWPN*: the same kind of program with point-triangle distances "
               "(`bench/paper/scatter.cpp`). Models: {}.\n\n",
               origins) +
           table({"model", "triangles [K], paper / here", "AWPN, paper", "AWPN", "double layer, paper", "dense, plain",
                  "dense", "dense, recursive", "samples, Algorithm 1 / recursive"},
                 rivals) +
           "\nbilayer beside it, seconds on 1 and 2 threads, half width 2; OpenVDB is `meshToVolume` without "
           "renormalisation:\n\n" +
           table({"model", "dense", "double-layer, 1", "2", "exact, 1", "2", "pseudonormal, 1", "2", "OpenVDB, 1", "2"},
                 ours) +
           remarksTable2(gains, byRows, byRecursion, awpn, serial, more);
}

std::string counted(int count) {
    return count == 1 ? "1 thread" : fmt::format("{} threads", count);
}

// Notes a row where our time exceeds another's.
void note(std::vector<std::string>& found, const std::string& where, const std::string& what, double ours,
          const std::string& other, double theirs, const std::string& shown) {
    if (ours > theirs) found.push_back(fmt::format("{}: {} {} s, {} {} s.", where, what, digits(ours), other, shown));
}
void note(std::vector<std::string>& found, const std::string& where, const std::string& what, double ours,
          const std::string& other, double theirs) {
    note(found, where, what, ours, other, theirs, digits(theirs));
}

// The same against a number of the paper's.
void notePapers(std::vector<std::string>& found, const std::string& where, const std::string& what, double ours,
                const std::string& papers, double theirs) {
    note(found, where, what, ours, fmt::format("the paper's {} on a {}", papers, published::processor), theirs,
         printed(theirs));
}

std::vector<std::string> behindTable2(const json& data) {
    std::vector<std::string> found;
    for (const json& row : data["rows"]) {
        const std::string model = row["model"], where = "Table 2, " + model;
        const published::Seconds& paper = published23(model);
        const std::vector<std::pair<const char*, const char*>> ours{
            {"layers", "`double-layer`"}, {"exact", "`exact`"}, {"pseudonormal", "`pseudonormal`"}};
        for (const auto& [key, name] : ours) {
            const auto seconds = [&](const char* which, int count) {
                return value(row, fmt::format("{} {}", which, count).c_str());
            };
            const std::string alone = fmt::format("{} on 1 thread", name);
            notePapers(found, where, alone, seconds(key, 1), "double layer", paper.serial);
            notePapers(found, where, alone, seconds(key, 1), "AWPN", paper.awpn);
            for (const int count : {1, threads})
                note(found, where, fmt::format("{} on {}", name, counted(count)), seconds(key, count),
                     "OpenVDB on as many", seconds("openvdb", count));
        }
    }
    return found;
}

json measureTable3(const Run& run) {
    json rows = json::array();
    const Lattice lattice = latticeOf(tableNodes);
    const std::vector<Engine> all = engines();
    if (all.empty()) return {{"skipped", "no OpenCL device"}};
    for (const published::Seconds& paper : published::tables23) {
        auto model = findModel(paper.model, run.meshes);
        if (!model) continue;
        const Scene scene{model->name, float(tableNodes), fitted(std::move(model->mesh), lattice), lattice.step};
        for (const Engine& engine : all) {
            json row =
                onDevice(engine, scene, {Builder::prism, Builder::doubleLayerOpencl, Builder::exactOpencl}, run.rounds);
            row["model"] = model->name;
            rows.push_back(row);
        }
    }
    return {{"rows", rows}};
}

double clocked(const json& row, Builder builder) {
    return row["clock"][bench::nameOf(builder)]["kernels"];
}

double whole(const json& row, Builder builder) {
    return row["whole"][bench::nameOf(builder)];
}

std::string textTable3(const json& data) {
    std::vector<std::vector<std::string>> rows;
    std::vector<std::string> hosts;  // devices where most of the prism method's build time is outside the kernels
    for (const json& row : data["rows"]) {
        const std::string model = row["model"];
        const published::Seconds& paper = published23(model);
        if (2 * clocked(row, Builder::prism) < whole(row, Builder::prism) &&
            !std::count(hosts.begin(), hosts.end(), model))
            hosts.push_back(model);
        std::vector<std::string> cells{model, nameOf(row), printed(paper.prism)};
        const auto both = [&](Builder builder) {
            cells.push_back(seconds(clocked(row, builder)) + " / " + seconds(whole(row, builder)));
        };
        both(Builder::prism);
        cells.push_back(printed(paper.opencl));
        both(Builder::doubleLayerOpencl);
        both(Builder::exactOpencl);
        cells.push_back(fmt::format("{:.1f} / {:.1f}",
                                    clocked(row, Builder::prism) / clocked(row, Builder::doubleLayerOpencl),
                                    clocked(row, Builder::prism) / clocked(row, Builder::exactOpencl)));
        rows.push_back(cells);
    }
    return fmt::format(
               "OpenCL at {}^3, half width 2. The paper gives the kernels' seconds by the device's clock, on a {}; "
               "here the kernels, then the whole build, mesh in memory to grid in memory, the host's part on {} "
               "threads.\n\n",
               tableNodes, published::processor, threads) +
           table({"model", "device", "prism [11], paper", "prism", "double layer, paper", "double-layer", "exact",
                  "prism's kernels over double-layer's / exact's"},
                 rows) +
           "\nThe paper starts a work-item for each triangle and ran on all cores of its Xeon; here a work-item fills "
           "a "
           "block of voxels, on the compute units named.\n" +
           (hosts.empty()
                ? ""
                : fmt::format("\nThe prism method needs the neighbours of each triangle, which the host finds: "
                              "the larger part of its whole build is the host's where the model is {}.\n",
                              fmt::join(hosts, " or ")));
}

std::vector<std::string> behindTable3(const json& data) {
    std::vector<std::string> found;
    for (const json& row : data["rows"]) {
        const std::string model = row["model"], where = "Table 3, " + model;
        const published::Seconds& paper = published23(model);
        const std::string here = " on " + nameOf(row);
        const double prism = clocked(row, Builder::prism);
        for (const auto& [builder, name] : {std::pair(Builder::doubleLayerOpencl, "`double-layer`'s kernels"),
                                            std::pair(Builder::exactOpencl, "`exact`'s kernels")}) {
            const double ours = clocked(row, builder);
            notePapers(found, where, name + here, ours, "double layer", paper.opencl);
            note(found, where, name + here, ours, "`prism`'s on the same device", prism);
        }
        notePapers(found, where, "`prism`'s kernels" + here, prism, "prism", paper.prism);
    }
    return found;
}

// Memory that is available without swapping [bytes].
double memoryAvailable() {
    std::ifstream file("/proc/meminfo");
    std::string word;
    double kiB = 0;
    while (file >> word)
        if (word == "MemAvailable:") file >> kiB;
    return kiB * 1024;
}

constexpr double room = 1.2;  // the dense program runs only if this times its two grids is available

// Peaks are measured first, in processes of their own: a process with threads cannot be forked.
json peaks(const Mesh& box, const Lattice& lattice, bool fits) {
    Scene scene{"circular box", float(lattice.nodes.x), {}, lattice.step};
    const auto make = [&] {
        Scene made = scene;
        made.mesh = stretched(box, lattice);
        return made;
    };
    json result;
    for (const Builder builder : {Builder::doubleLayer, Builder::exact})
        result[bench::nameOf(builder)] = bench::inChild(make, {builder, halfWidth, threads}).peakBytes;
    if (fits)
        result["dense"] = bench::peakInChild([&] { scene = make(); }, [&] { denseDoubleLayer(scene.mesh, lattice); });
    return result;
}

json measureTable4(const Run& run) {
    json rows = json::array();
    const auto model = findModel("circular box", run.meshes);
    for (const published::Growth& paper : published::table4) {
        const Lattice lattice = latticeOf({paper.nodes[0], paper.nodes[1], paper.nodes[2]});
        const double bytes = 2.0 * sizeof(float) * double(lattice.count());
        const bool fits = memoryAvailable() > room * bytes;
        rows.push_back(
            {{"nodes", paper.nodes}, {"fits", fits}, {"bytes", bytes}, {"peaks", peaks(model->mesh, lattice, fits)}});
    }
    const std::vector<Engine> all = engines();
    for (json& row : rows) {
        const std::array<int, 3> nodes = row["nodes"];
        const Lattice lattice = latticeOf({nodes[0], nodes[1], nodes[2]});
        const Scene scene{"circular box", float(nodes[0]), stretched(model->mesh, lattice), lattice.step};
        fmt::print(stderr, "  {}\n", fmt::join(nodes, " x "));
        std::vector<Contender> contenders{builder("layers", scene, {Builder::doubleLayer, halfWidth, threads}),
                                          builder("exact", scene, {Builder::exact, halfWidth, threads})};
        if (row["fits"]) contenders.push_back(dense("dense", scene, lattice));
        row["seconds"] = medians(contenders, run.rounds);
        row["active"] = bench::run(scene, {Builder::doubleLayer, halfWidth, threads}).activeVoxels;
        row["devices"] = json::array();
        for (const Engine& engine : all)
            row["devices"].push_back(
                onDevice(engine, scene, {Builder::doubleLayerOpencl, Builder::exactOpencl}, run.rounds));
    }
    return {{"rows", rows}, {"triangles", model->mesh.triangles.size()}};
}

std::string textTable4(const json& data) {
    std::vector<std::vector<std::string>> times, memory;
    double most = 0;
    for (std::size_t i = 0; i < published::table4.size(); ++i) {
        const published::Growth& paper = published::table4[i];
        const json& row = data["rows"][i];
        const std::string grid = fmt::format("{}", fmt::join(paper.nodes, "x"));
        const double serial = value(row["seconds"], "dense");
        const auto optional = [](const std::optional<double>& s) {
            return s ? printed(*s) : std::string("out of memory");
        };
        std::vector<std::string> cells{grid,
                                       printed(paper.serial),
                                       seconds(serial),
                                       optional(paper.tesla),
                                       printed(paper.opencl),
                                       seconds(value(row["seconds"], "layers"))};
        std::vector<std::string> bytes{grid, fmt::format("{:.0f}", row["bytes"].get<double>() / MiB)};
        const auto mebibytes = [](const json& peak) {
            return peak.is_number() ? fmt::format("{:.0f}", peak.get<double>() / MiB) : "-";
        };
        bytes.push_back(mebibytes(row["peaks"].value("dense", json())));
        bytes.push_back(mebibytes(row["peaks"]["double-layer"]));
        bytes.push_back(mebibytes(row["peaks"]["exact"]));
        for (const json& device : row["devices"]) {
            cells.push_back(seconds(clocked(device, Builder::doubleLayerOpencl)) + " / " +
                            seconds(whole(device, Builder::doubleLayerOpencl)));
            bytes.push_back(mebibytes(device["clock"]["double-layer-opencl"]["peak"]));
            bytes.push_back(mebibytes(device["clock"]["exact-opencl"]["peak"]));
        }
        cells.push_back(fmt::format("{:.1f}", paper.serial / paper.opencl));
        cells.push_back(std::isfinite(serial) ? fmt::format("{:.1f}", serial / value(row["seconds"], "layers")) : "-");
        for (const json& device : row["devices"])
            cells.push_back(std::isfinite(serial)
                                ? fmt::format("{:.1f}", serial / clocked(device, Builder::doubleLayerOpencl))
                                : "-");
        cells.push_back(seconds(value(row["seconds"], "exact")));
        for (const json& device : row["devices"])
            cells.push_back(seconds(clocked(device, Builder::exactOpencl)) + " / " +
                            seconds(whole(device, Builder::exactOpencl)));
        bytes.push_back(fmt::format("{:.1f}", row["active"].get<double>() / 1e6));
        for (const char* name : {"double-layer", "exact"})
            most = std::max(most, row["peaks"][name].get<double>() / MiB);
        times.push_back(cells);
        memory.push_back(bytes);
    }
    std::vector<std::string> head{"grid", "serial, paper", "serial (dense)", "Tesla, paper", "OpenCL, paper", "TBB"},
        memoryHead{"grid", "two dense grids", "serial (dense)", "TBB, double-layer", "TBB, exact"};
    const json& devices = data["rows"][0]["devices"];
    bool gpu = false;
    for (std::size_t i = 0; i < devices.size(); ++i) {
        gpu = gpu || devices[i].value("gpu", false);
        head.push_back(fmt::format("OpenCL {}, kernels / whole", i + 1));
        memoryHead.push_back(fmt::format("OpenCL {}, device, double-layer", i + 1));
        memoryHead.push_back("exact");
    }
    head.insert(head.end(), {"serial over OpenCL, paper", "serial over TBB"});
    for (std::size_t i = 0; i < devices.size(); ++i)
        head.push_back(fmt::format("serial over OpenCL {}'s kernels", i + 1));
    head.push_back("exact, TBB");
    for (std::size_t i = 0; i < devices.size(); ++i)
        head.push_back(fmt::format("exact, OpenCL {}, kernels / whole", i + 1));
    memoryHead.push_back("active voxels [M]");
    return fmt::format(
               "The circular box ({} triangles here); seconds, double layer with half width 2. Here it is made as high "
               "as its grid, by a scale of its own for each axis, on the first three grids too; in Tables 2 and 3 one "
               "scale holds for all axes. Steps are the same along all axes. TBB, and the host's part of OpenCL, on {} "
               "threads.{}\n\n",
               data["triangles"].get<int>(), threads, legend(devices)) +
           table(head, times) + "\nMost memory in use at once [MiB], beside the mesh:\n\n" + table(memoryHead, memory) +
           fmt::format(
               "\nThe serial program clears and reads two grids of the whole box, so that its time grows with the box; "
               "here both time and memory grow with the surface, and no grid runs out of memory (on TBB {:.0f} MiB at "
               "most). "
               "The paper's ratios set all cores of a {} and their vectors against one core without; these, {} threads "
               "or a device's compute units.{}\n",
               most, published::processor, threads, gpu ? "" : " No GPU was at hand for the Tesla's column.");
}

// Our methods in Tables 4 and 5.
constexpr std::array onTbb{std::pair("layers", "`double-layer`"), std::pair("exact", "`exact`")};
constexpr std::array onDevices{std::pair(Builder::doubleLayerOpencl, "`double-layer`"),
                               std::pair(Builder::exactOpencl, "`exact`")};

// Grids of Table 4 where one of ours is slower than one of the paper's, or has a smaller speed-up over the serial
// program.
struct Lag {
    std::vector<std::string> opencl, tesla, gain;

    void add(const published::Growth& paper, double ours, double serial) {
        const std::string grid = fmt::format("{}", fmt::join(paper.nodes, "x"));
        const double ratio = serial / ours, papers = paper.serial / paper.opencl;
        const auto slower = [&](std::vector<std::string>& list, double theirs) {
            if (ours > theirs) list.push_back(fmt::format("{} s and {} at {}", digits(ours), printed(theirs), grid));
        };
        slower(opencl, paper.opencl);
        if (paper.tesla) slower(tesla, *paper.tesla);
        if (ratio < papers) gain.push_back(fmt::format("{:.1f} and {:.1f} at {}", ratio, papers, grid));
    }
    void tell(const std::string& what, std::vector<std::string>& found) const {
        const auto line = [&](const std::vector<std::string>& list, const std::string& with) {
            if (!list.empty())
                found.push_back(fmt::format("Table 4, {} and {}: {}.", what, with, fmt::join(list, "; ")));
        };
        line(opencl, std::string("the paper's double layer on a ") + published::processor);
        line(tesla, std::string("the paper's on a ") + published::gpu);
        line(gain, std::string("the paper's on a ") + published::processor +
                       ", how many times as fast as the serial program");
    }
};

std::vector<std::string> behindTable4(const json& data) {
    std::vector<std::string> found;
    const json& rows = data["rows"];
    const auto compare = [&](const std::string& what, const std::function<double(const json&)>& ours) {
        Lag lag;
        for (std::size_t i = 0; i < published::table4.size(); ++i)
            lag.add(published::table4[i], ours(rows[i]), value(rows[i]["seconds"], "dense"));
        lag.tell(what, found);
    };
    for (const auto& [key, name] : onTbb)
        compare(fmt::format("{} on TBB, {} threads,", name, threads),
                [key = key](const json& row) { return value(row["seconds"], key); });
    const json& devices = rows[0]["devices"];
    for (std::size_t k = 0; k < devices.size(); ++k)
        for (const auto& [builder, name] : onDevices)
            compare(fmt::format("{}'s kernels on {}", name, nameOf(devices[k])),
                    [k, builder = builder](const json& row) { return clocked(row["devices"][k], builder); });
    return found;
}

// Eq. 5.
double variance(const Mesh& mesh) {
    double sum = 0, squares = 0;
    for (const glm::uvec3& t : mesh.triangles) {
        const glm::dvec3 a(mesh.points[t.x]), b(mesh.points[t.y]), c(mesh.points[t.z]);
        const double area = 0.5 * glm::length(glm::cross(b - a, c - a));
        sum += area;
        squares += area * area;
    }
    const double count = double(mesh.triangles.size());
    return squares / count - sum / count * (sum / count);
}

constexpr double flat = 1.25;  // times the first row's time

json measureTable5(const Run& run) {
    json rows = json::array();
    const Lattice lattice = latticeOf(tableNodes);
    const std::vector<Engine> all = engines();
    for (const published::Uneven& paper : published::table5) {
        const Scene scene{"sphere", float(tableNodes), unevenSphere(paper.variance, lattice), lattice.step};
        const DenseField field = denseDoubleLayer(scene.mesh, lattice);
        json row{{"variance", variance(scene.mesh)},
                 {"triangles", scene.mesh.triangles.size()},
                 {"samples", field.samples},
                 {"mostSamples", field.maxSamples}};
        row["seconds"] =
            medians({builder("layers", scene, {Builder::doubleLayer, halfWidth, threads}),
                     builder("exact", scene, {Builder::exact, halfWidth, threads}), dense("dense", scene, lattice)},
                    2 * run.rounds + 1);
        row["devices"] = json::array();
        for (const Engine& engine : all)
            row["devices"].push_back(
                onDevice(engine, scene, {Builder::doubleLayerOpencl, Builder::exactOpencl}, 2 * run.rounds + 1));
        rows.push_back(row);
    }
    return {{"rows", rows}, {"radius", 0.5 * lattice.step * (tableNodes - 1 - 2 * marginNodes)}};
}

std::string textTable5(const json& data) {
    std::vector<std::vector<std::string>> rows;
    std::vector<std::vector<double>> times;
    const std::size_t devices = data["rows"][0]["devices"].size();
    for (std::size_t i = 0; i < published::table5.size(); ++i) {
        const published::Uneven& paper = published::table5[i];
        const json& row = data["rows"][i];
        times.push_back({paper.seconds});
        for (const json& device : row["devices"]) {
            times.back().push_back(clocked(device, Builder::doubleLayerOpencl));
            times.back().push_back(whole(device, Builder::doubleLayerOpencl));
            times.back().push_back(clocked(device, Builder::exactOpencl));
            times.back().push_back(whole(device, Builder::exactOpencl));
        }
        for (const char* name : {"layers", "exact", "dense"}) times.back().push_back(value(row["seconds"], name));
        std::vector<std::string> cells{fmt::format("{} / {:.4f}", paper.variance, row["variance"].get<double>())};
        for (const double time : times.back())
            cells.push_back(cells.size() == 1 ? printed(paper.seconds) : seconds(time));
        cells.push_back(
            fmt::format("{} / {}", row["samples"].get<std::uint64_t>(), row["mostSamples"].get<std::uint64_t>()));
        rows.push_back(cells);
    }
    std::vector<std::string> last{"last over first"};
    for (std::size_t k = 0; k < times[0].size(); ++k)
        last.push_back(fmt::format("{:.2f}", times.back()[k] / times.front()[k]));
    last.push_back("");
    rows.push_back(last);
    std::vector<std::string> head{"variance, paper / here", "OpenCL, paper"};
    for (std::size_t i = 0; i < devices; ++i)
        for (const char* what : {"double-layer, kernels", "double-layer, whole", "exact, kernels", "exact, whole"})
            head.push_back(fmt::format("OpenCL {}, {}", i + 1, what));
    head.insert(head.end(), {"TBB, double-layer", "TBB, exact", "serial (dense)", "samples, all / of one triangle"});
    return fmt::format(
               "A sphere of {} triangles at {}^3, seconds; TBB, and the host's part of OpenCL, on {} threads.{} The "
               "paper does not say how large its sphere is, on which "
               "the variance of areas (Eq. 5) depends: here it fills the grid, with a radius of {:.2f} in a box of "
               "side {}, and its triangles are small around one pole and large around the other.\n\n",
               data["rows"][0]["triangles"].get<int>(), tableNodes, threads, legend(data["rows"][0]["devices"]),
               data["radius"].get<double>(), boxSide) +
           table(head, rows) +
           "\nThe paper gives a work-item a triangle, so the largest one sets the time. Here a work-item, or a task, "
           "fills a block, and a triangle costs what it touches.\n";
}

std::vector<std::string> behindTable5(const json& data) {
    std::vector<std::string> found;
    const json& rows = data["rows"];
    const auto growth = [&](const std::string& what, const std::function<double(const json&)>& time) {
        double most = 0;
        for (const json& row : rows) most = std::max(most, time(row) / time(rows[0]));
        if (most > flat)
            found.push_back(
                fmt::format("Table 5, {}: {:.2f} times as long for the worst variance as for the first.", what, most));
    };
    for (const auto& [key, name] : onTbb)
        growth(fmt::format("{} on TBB, {} threads", name, threads),
               [key = key](const json& row) { return value(row["seconds"], key); });
    const json& devices = rows[0]["devices"];
    for (std::size_t k = 0; k < devices.size(); ++k)
        for (const auto& [builder, name] : onDevices) {
            const std::string here = " on " + nameOf(devices[k]);
            const auto kernels = [k, builder = builder](const json& row) {
                return clocked(row["devices"][k], builder);
            };
            growth(name + ("'s kernels" + here), kernels);
            growth(name + (", whole," + here),
                   [k, builder = builder](const json& row) { return whole(row["devices"][k], builder); });
            for (std::size_t i = 0; i < published::table5.size(); ++i)
                notePapers(found, fmt::format("Table 5, variance {}", published::table5[i].variance),
                           name + ("'s kernels" + here), kernels(rows[i]), "double layer",
                           published::table5[i].seconds);
        }
    return found;
}

}  // namespace

std::vector<Part> speedParts() {
    return {{"table2", "Table 2: one core", measureTable2, textTable2, behindTable2},
            {"table3", "Table 3: OpenCL", measureTable3, textTable3, behindTable3},
            {"table4", "Table 4: growing grids", measureTable4, textTable4, behindTable4},
            {"table5", "Table 5: triangles of unlike areas", measureTable5, textTable5, behindTable5}};
}

}  // namespace bilayer::paper
