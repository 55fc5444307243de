// What fields take: Tables 2 to 5.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <fstream>
#include <functional>
#include <glm/geometric.hpp>
#include <memory>
#include <stdexcept>

#include "bench/builders.h"
#include "bench/measure.h"
#include "bench/paper/markdown.h"
#include "bench/paper/models.h"
#include "bench/paper/part.h"
#include "bench/paper/published.h"
#include "bench/paper/scatter.h"
#include "cl/filler.h"
#include "demos/shared/shapes.h"

namespace bilayer::paper {
namespace {

using bench::Builder;
using bench::Scene;
using bench::Stopwatch;
using nlohmann::json;

constexpr float halfWidth = 2;      // "about 2 Delta away from the triangle mesh", for all [steps]
constexpr int threads = 2;          // of those that take more than one
constexpr double mostSeconds = 25;  // a builder takes no further turns once it has used up these
constexpr double MiB = 1 << 20;

// Something that is timed by turns.
struct Contender {
    std::string name;
    std::function<void()> work;
    std::vector<double> seconds{};
};

// Contenders take turns, so that a slow minute hits all of them alike. The first round is kept: a mesh is built once.
json medians(std::vector<Contender> contenders, int rounds) {
    for (int round = 0; round < rounds; ++round)
        for (Contender& contender : contenders) {
            double spent = 0;
            for (const double s : contender.seconds) spent += s;
            if (spent > mostSeconds) continue;
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

// An OpenCL device, and what builds there without and with its clock.
struct Engine {
    DeviceInfo info;
    std::unique_ptr<OpenclTimes> times;
    BlockFiller timed, profiled;
};

std::vector<Engine> engines() {
    std::vector<Engine> all;
    for (const DeviceInfo& info : devices()) {
        const Device device = openDevice(info.name);
        auto times = std::make_unique<OpenclTimes>();
        OpenclTimes* const clock = times.get();
        all.push_back({device.info(), std::move(times), openclFiller(device), openclFiller(device, {.times = clock})});
    }
    return all;
}

// By the device's clock, as the paper measured: seconds of the kernels, and the peak of device memory.
json profiled(const Engine& engine, const Scene& scene, Builder builder, int rounds) {
    std::vector<double> kernels;
    std::uint64_t peak = 0;
    for (int round = 0; round < rounds; ++round) {
        *engine.times = {};
        bench::run(scene, {builder, halfWidth, threads, &engine.profiled});
        kernels.push_back(engine.times->kernels);
        peak = std::max(peak, engine.times->peakBytes);
    }
    return {{"kernels", bench::median(kernels)}, {"peak", peak}};
}

// What a device takes for some builders: a warm-up, which compiles, turns, and the device's own clock.
json onDevice(const Engine& engine, const Scene& scene, const std::vector<Builder>& builders, int rounds) {
    std::vector<Contender> contenders;
    for (const Builder which : builders) {
        const bench::Job job{which, halfWidth, threads, &engine.timed};
        bench::run(scene, job);
        contenders.push_back(builder(bench::nameOf(which), scene, job));
    }
    json result{{"device", engine.info.name}, {"gpu", engine.info.gpu}, {"whole", medians(contenders, rounds)}};
    for (const Builder which : builders) result["clock"][bench::nameOf(which)] = profiled(engine, scene, which, rounds);
    return result;
}

constexpr int tableNodes = 251;

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

std::string textTable2(const json& data) {
    std::vector<std::vector<std::string>> rivals, ours;
    std::string origins;
    std::vector<double> gains, byRows, byRecursion;
    for (const json& row : data["rows"]) {
        const std::string model = row["model"];
        const published::Seconds& paper = published23(model);
        rivals.push_back(
            {model, fmt::format("{} / {:.2f}", paper.triangles, row["triangles"].get<double>() / published::thousand),
             digits(paper.awpn), seconds(value(row, "awpn")), digits(paper.serial), seconds(value(row, "plain")),
             seconds(value(row, "dense")), seconds(value(row, "recursive")),
             fmt::format("{} / {}", row["samples"].get<std::uint64_t>(),
                         row["recursiveSamples"].get<std::uint64_t>())});
        ours.push_back({model, seconds(value(row, "dense"))});
        for (const char* name : {"layers 1", "layers 2", "exact 1", "exact 2", "pseudonormal 1", "pseudonormal 2",
                                 "openvdb 1", "openvdb 2"})
            ours.back().push_back(seconds(value(row, name)));
        gains.push_back(value(row, "dense") / value(row, "layers 1"));
        byRows.push_back(value(row, "plain") / value(row, "dense"));
        byRecursion.push_back(value(row, "recursive") / value(row, "dense"));
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
           fmt::format(
               "\nOn one thread the block-wise double layer is {:.1f} times as fast as the dense program in the "
               "geometric mean: no grid of the whole box is cleared and read, a block stays in cache, and a vector of "
               "samples or voxels goes at once. With the rows of section 4.2 the dense program takes {:.2f} of its "
               "time without: the compiler takes invariant products out of loops by itself. With the recursive "
               "subdivision it takes {:.2f} of its time with Algorithm 1, which rounds the number of rows up and takes "
               "more samples.\n",
               bench::geometricMean(gains), bench::geometricMean(byRows), bench::geometricMean(byRecursion));
}

// A line where our seconds are more than another's.
void note(std::vector<std::string>& found, const std::string& where, const char* what, double ours,
          const std::string& other, double theirs) {
    if (ours > theirs)
        found.push_back(fmt::format("{}: {} {} s, {} {} s.", where, what, digits(ours), other, digits(theirs)));
}

std::vector<std::string> behindTable2(const json& data) {
    std::vector<std::string> found;
    for (const json& row : data["rows"]) {
        const std::string model = row["model"], where = "Table 2, " + model;
        const published::Seconds& paper = published23(model);
        note(found, where, "`double-layer` on 1 thread", value(row, "layers 1"), "the paper's program there",
             paper.serial);
        note(found, where, "`exact` on 1 thread", value(row, "exact 1"), "AWPN there", paper.awpn);
        note(found, where, "`pseudonormal` on 1 thread", value(row, "pseudonormal 1"), "AWPN there", paper.awpn);
        for (const char* name : {"layers 2", "exact 2", "pseudonormal 2"})
            note(found, where, name, value(row, name), "OpenVDB on 2 threads", value(row, "openvdb 2"));
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
    for (const json& row : data["rows"]) {
        const std::string model = row["model"];
        const published::Seconds& paper = published23(model);
        std::vector<std::string> cells{model, row["device"], digits(paper.prism, 2)};
        const auto both = [&](Builder builder) {
            cells.push_back(seconds(clocked(row, builder)) + " / " + seconds(whole(row, builder)));
        };
        both(Builder::prism);
        cells.push_back(digits(paper.opencl, 2));
        both(Builder::doubleLayerOpencl);
        both(Builder::exactOpencl);
        cells.push_back(fmt::format("{:.1f} / {:.1f}",
                                    clocked(row, Builder::prism) / clocked(row, Builder::doubleLayerOpencl),
                                    clocked(row, Builder::prism) / clocked(row, Builder::exactOpencl)));
        rows.push_back(cells);
    }
    return "OpenCL at 251^3, half width 2. The paper gives the kernels' seconds by the device's clock, on six cores; "
           "here the kernels, then the whole build, mesh in memory to grid in memory, on " +
           fmt::format("{} threads.\n\n", threads) +
           table({"model", "device", "prism [11], paper", "prism", "double layer, paper", "double-layer", "exact",
                  "prism's kernels over double-layer's / exact's"},
                 rows) +
           "\nThe prism method's whole build is mostly the host's: it needs the neighbours of each triangle.\n";
}

std::vector<std::string> behindTable3(const json& data) {
    std::vector<std::string> found;
    for (const json& row : data["rows"]) {
        const std::string model = row["model"], where = "Table 3, " + model;
        const published::Seconds& paper = published23(model);
        note(found, where, "`double-layer`'s kernels", clocked(row, Builder::doubleLayerOpencl),
             "the paper's on six cores", paper.opencl);
        note(found, where, "`exact`'s kernels", clocked(row, Builder::exactOpencl),
             "the paper's double layer on six cores", paper.opencl);
        note(found, where, "`prism`'s kernels", clocked(row, Builder::prism), "the paper's on six cores", paper.prism);
    }
    return found;
}

// What can be had without swapping [bytes].
double memoryAvailable() {
    std::ifstream file("/proc/meminfo");
    std::string word;
    double kiB = 0;
    while (file >> word)
        if (word == "MemAvailable:") file >> kiB;
    return kiB * 1024;
}

constexpr double room = 1.2;  // times its two grids that must be available for the dense program

// Peaks are taken first, in processes of their own: a process that has started threads cannot be forked.
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
            return s ? digits(*s) : std::string("out of memory");
        };
        std::vector<std::string> cells{grid,
                                       digits(paper.serial, 4),
                                       seconds(serial),
                                       optional(paper.tesla),
                                       digits(paper.opencl),
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
        for (const json& device : row["devices"]) cells.push_back(seconds(whole(device, Builder::exactOpencl)));
        bytes.push_back(fmt::format("{:.1f}", row["active"].get<double>() / 1e6));
        for (const char* name : {"double-layer", "exact"})
            most = std::max(most, row["peaks"][name].get<double>() / MiB);
        times.push_back(cells);
        memory.push_back(bytes);
    }
    std::vector<std::string> head{"grid", "serial, paper", "serial (dense)", "Tesla, paper", "OpenCL, paper", "TBB"},
        memoryHead{"grid", "two dense grids", "serial (dense)", "TBB, double-layer", "TBB, exact"};
    const json& devices = data["rows"][0]["devices"];
    std::string names;
    bool gpu = false;
    for (std::size_t i = 0; i < devices.size(); ++i) {
        gpu = gpu || devices[i].value("gpu", false);
        names += fmt::format("{}OpenCL {}: {}", i ? "; " : "", i + 1, devices[i]["device"].get<std::string>());
        head.push_back(fmt::format("OpenCL {}, kernels / whole", i + 1));
        memoryHead.push_back(fmt::format("OpenCL {}, device, double-layer", i + 1));
        memoryHead.push_back("exact");
    }
    head.insert(head.end(), {"serial over OpenCL, paper", "serial over TBB"});
    for (std::size_t i = 0; i < devices.size(); ++i)
        head.push_back(fmt::format("serial over OpenCL {}'s kernels", i + 1));
    head.push_back("exact, TBB");
    for (std::size_t i = 0; i < devices.size(); ++i) head.push_back(fmt::format("exact, OpenCL {}", i + 1));
    memoryHead.push_back("active voxels [M]");
    return fmt::format(
               "The circular box ({} triangles here), stretched along y as a finer step there sees it; seconds, double "
               "layer with half width 2, {} threads. {}.\n\n",
               data["triangles"].get<int>(), threads, names) +
           table(head, times) + "\nMost memory in use at once [MiB], beside the mesh:\n\n" + table(memoryHead, memory) +
           fmt::format(
               "\nThe serial program clears and reads two grids of the whole box, so that its time grows with the box; "
               "here both time and memory grow with the surface, and no grid runs out of memory ({:.0f} MiB at most). "
               "The paper's ratios set six cores and their vectors against one core without; these are of {} "
               "cores.{}\n",
               most, threads, gpu ? "" : " No GPU was at hand for the Tesla's column.");
}

std::vector<std::string> behindTable4(const json& data) {
    std::vector<std::string> slower, lower;
    for (std::size_t i = 0; i < published::table4.size(); ++i) {
        const published::Growth& paper = published::table4[i];
        const json& row = data["rows"][i];
        const std::string grid = fmt::format("{}", fmt::join(paper.nodes, "x"));
        for (const json& device : row["devices"]) {
            const double kernels = clocked(device, Builder::doubleLayerOpencl),
                         ratio = value(row["seconds"], "dense") / kernels, papers = paper.serial / paper.opencl;
            if (kernels > paper.opencl)
                slower.push_back(fmt::format("{} s and {} at {}", digits(kernels), digits(paper.opencl), grid));
            if (ratio < papers) lower.push_back(fmt::format("{:.1f} and {:.1f} times at {}", ratio, papers, grid));
        }
    }
    std::vector<std::string> found;
    if (!slower.empty())
        found.push_back(fmt::format("Table 4, `double-layer`'s kernels on {} cores and the paper's on six: {}.",
                                    threads, fmt::join(slower, "; ")));
    if (!lower.empty())
        found.push_back(
            fmt::format("Table 4, how many times as fast as the serial program, ours on {} cores and the "
                        "paper's on six: {}.",
                        threads, fmt::join(lower, "; ")));
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

// The sphere that fills the grid as other models do.
Mesh unevenSphere(double areaVariance, const Lattice& lattice) {
    const double radius = 0.5 * lattice.step * (lattice.nodes.x - 1 - 2 * marginNodes);
    const auto triangles = 2 * std::size_t(std::lround(published::sphereTriangles * published::thousand / 2));
    Mesh mesh = shapes::unevenSphere(float(std::sqrt(areaVariance) / (radius * radius)), triangles);
    const glm::vec3 centre(0.5f * lattice.step * float(lattice.nodes.x - 1));
    for (glm::vec3& p : mesh.points) p = p * float(radius) + centre;
    return mesh;
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
                 {"mostSamples", field.mostSamples}};
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
            times.back().push_back(whole(device, Builder::exactOpencl));
        }
        for (const char* name : {"layers", "exact", "dense"}) times.back().push_back(value(row["seconds"], name));
        std::vector<std::string> cells{fmt::format("{} / {:.4f}", paper.variance, row["variance"].get<double>())};
        for (const double time : times.back()) cells.push_back(seconds(time));
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
        for (const char* what : {"double-layer, kernels", "double-layer, whole", "exact, whole"})
            head.push_back(fmt::format("OpenCL {}, {}", i + 1, what));
    head.insert(head.end(), {"TBB, double-layer", "TBB, exact", "serial (dense)", "samples, all / of one triangle"});
    return fmt::format(
               "A sphere of {} triangles at 251^3, seconds. The paper does not say how large its sphere is, on which "
               "the variance of areas (Eq. 5) depends: here it fills the grid, with a radius of {:.2f} in a box of "
               "side {}, and its triangles are small around one pole and large around the other.\n\n",
               data["rows"][0]["triangles"].get<int>(), data["radius"].get<double>(), boxSide) +
           table(head, rows) +
           "\nThe paper gives a work-item a triangle, so the largest one sets the time. Here a work-item, or a task, "
           "fills a block, and a triangle costs what it touches.\n";
}

std::vector<std::string> behindTable5(const json& data) {
    std::vector<std::string> found;
    for (const char* name : {"layers", "exact"}) {
        const double growth =
            value(data["rows"].back()["seconds"], name) / value(data["rows"].front()["seconds"], name);
        if (growth > flat)
            found.push_back(fmt::format(
                "Table 5: {} on TBB takes {:.2f} times as long for the last variance as for the first.", name, growth));
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
