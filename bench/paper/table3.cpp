// SPDX-License-Identifier: Apache-2.0
// Table 3: build times on OpenCL devices.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <algorithm>

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
               "OpenCL at {}^3, half width 2. The paper gives the kernels' seconds by the device's clock, on a {}. "
               "Here "
               "the first number is the kernels', and the second one that of the whole build, from a mesh in memory to "
               "a grid in memory. The host's part runs on {} threads.\n\n",
               tableNodes, published::processor, threads) +
           table({"model", "device", "prism [11], paper", "prism", "double layer, paper", "double-layer", "exact",
                  "prism's kernels over double-layer's / exact's"},
                 rows) +
           "\nThe paper starts a work-item for each triangle, and ran on all cores of its Xeon. Here a work-item fills "
           "a block of voxels, on the compute units named.\n" +
           (hosts.empty()
                ? ""
                : fmt::format("\nThe prism method needs the neighbours of each triangle, which the host finds. The "
                              "host's part of its whole build is the larger one for: {}.\n",
                              fmt::join(hosts, ", ")));
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

}  // namespace

Part table3() {
    return {"table3", "Table 3: OpenCL", measureTable3, textTable3, behindTable3};
}

}  // namespace bilayer::paper
