// SPDX-License-Identifier: Apache-2.0
// Table 5: build times of triangles of unlike areas.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <algorithm>
#include <functional>
#include <glm/geometric.hpp>

#include "bench/builders.h"
#include "bench/paper/markdown.h"
#include "bench/paper/models.h"
#include "bench/paper/notes.h"
#include "bench/paper/part.h"
#include "bench/paper/published.h"
#include "bench/paper/timing.h"

namespace bilayer::paper {
namespace {

using bench::Builder;
using bench::Scene;
using nlohmann::json;
using published::tableNodes;

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
                 {"maxSamples", field.maxSamples}};
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
            fmt::format("{} / {}", row["samples"].get<std::uint64_t>(), row["maxSamples"].get<std::uint64_t>()));
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
               "A sphere of {} triangles at {}^3, seconds. TBB, and the host's part of OpenCL, run on {} threads.{} "
               "The "
               "variance of areas (Eq. 5) depends on the size of the sphere, which the paper does not state. Here it "
               "fills the grid, with a radius of {:.2f} in a box of side {}. Its triangles are small around one pole "
               "and large around the other.\n\n",
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
        double largest = 0;
        for (const json& row : rows) largest = std::max(largest, time(row) / time(rows[0]));
        if (largest > flat)
            found.push_back(fmt::format("Table 5, {}: {:.2f} times as long for the worst variance as for the first.",
                                        what, largest));
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

Part table5() {
    return {"table5", "Table 5: triangles of unlike areas", measureTable5, textTable5, behindTable5};
}

}  // namespace bilayer::paper
