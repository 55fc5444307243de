// SPDX-License-Identifier: Apache-2.0
// Table 4: build times and memory of growing grids.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <functional>

#include "bench/builders.h"
#include "bench/measure.h"
#include "bench/paper/markdown.h"
#include "bench/paper/models.h"
#include "bench/paper/part.h"
#include "bench/paper/published.h"
#include "bench/paper/timing.h"

namespace bilayer::paper {
namespace {

using bench::Builder;
using bench::Scene;
using nlohmann::json;

constexpr double MiB = 1 << 20;

// Memory that is available without swapping [bytes].
double memoryAvailable() {
    std::ifstream file("/proc/meminfo");
    std::string word;
    double kiB = 0;
    while (file >> word)
        if (word == "MemAvailable:") file >> kiB;
    return kiB * 1024;
}

constexpr double spareMemory = 1.2;  // the dense program runs only if this times its two grids is available

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
        const bool fits = memoryAvailable() > spareMemory * bytes;
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
    double largest = 0;
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
            largest = std::max(largest, row["peaks"][name].get<double>() / MiB);
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
               "The circular box ({} triangles here); seconds, double layer with half width 2. A scale for each axis "
               "makes it as high as its grid, on the first three grids too. In Tables 2 and 3 one scale holds for all "
               "axes. Steps are the same along all axes. TBB, and the host's part of OpenCL, run on {} threads.{}\n\n",
               data["triangles"].get<int>(), threads, legend(devices)) +
           table(head, times) + "\nPeak memory [MiB], in addition to the mesh:\n\n" + table(memoryHead, memory) +
           fmt::format(
               "\nThe serial program clears and reads two grids of the whole box, so its time grows with the box. Here "
               "time and memory grow with the surface, and no grid runs out of memory (at most {:.0f} MiB on TBB). The "
               "paper's ratios compare all cores of a {} and their vectors with one core without vectors. The ratios "
               "here compare {} threads, or a device's compute units, with one core.{}\n",
               largest, published::processor, threads, gpu ? "" : " No GPU was at hand for the Tesla's column.");
}

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
    void describe(const std::string& what, std::vector<std::string>& found) const {
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
        lag.describe(what, found);
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

}  // namespace

Part table4() {
    return {"table4", "Table 4: growing grids", measureTable4, textTable4, behindTable4};
}

}  // namespace bilayer::paper
