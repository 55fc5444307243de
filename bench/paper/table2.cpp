// SPDX-License-Identifier: Apache-2.0
// Table 2: build times on one core.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "bench/builders.h"
#include "bench/measure.h"
#include "bench/paper/markdown.h"
#include "bench/paper/models.h"
#include "bench/paper/notes.h"
#include "bench/paper/part.h"
#include "bench/paper/published.h"
#include "bench/paper/scatter.h"
#include "bench/paper/timing.h"

namespace bilayer::paper {
namespace {

using bench::Builder;
using bench::Scene;
using nlohmann::json;
using published::tableNodes;

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

std::string remarksTable2(const std::vector<double>& gains, const std::vector<double>& byRows,
                          const std::vector<double>& byRecursion, const std::vector<double>& awpn,
                          const std::vector<double>& serial, const std::vector<std::string>& more) {
    const double gain = bench::geometricMean(gains);
    return fmt::format(
               "\n- AWPN takes {:.1f} times as long as in the paper, the dense program, plain, {:.1f} times, in the "
               "geometric mean. These are plain programs on another processor, and the paper calls its AWPN \"totally "
               "optimised\".\n"
               "- On one thread the block-wise double layer is {:.1f} times as fast as the dense program.{}\n"
               "- With the rows of section 4.2 the dense program takes {:.2f} of its time without.{}\n"
               "- With the recursive subdivision it takes {:.2f} of its time with Algorithm 1, which the paper finds "
               "the faster one.",
               bench::geometricMean(awpn), bench::geometricMean(serial), gain,
               gain > 1
                   ? " It clears and reads no grid of the whole box, keeps a block in cache, and computes a vector "
                     "of samples or voxels at once."
                   : "",
               bench::geometricMean(byRows),
               bench::geometricMean(byRows) > 0.95 ? " The paper gains much by them; today's compilers take out of the "
                                                     "loop what is the same along a row."
                                                   : "",
               bench::geometricMean(byRecursion)) +
           (more.empty() ? "\n"
                         : fmt::format(" Algorithm 1 rounds the number of rows up, and takes more samples of: {}.\n",
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
               "Seconds at 251^3, one thread.\n\n"
               "- *Dense*: the paper's program, without and with the rows of section 4.2, and with the recursive "
               "subdivision.\n"
               "- *AWPN*: the same kind of program with point-triangle distances (`bench/paper/scatter.cpp`).\n"
               "- Models: {}.\n\n",
               origins) +
           table({"model", "triangles [K], paper / here", "AWPN, paper", "AWPN", "double layer, paper", "dense, plain",
                  "dense", "dense, recursive", "samples, Algorithm 1 / recursive"},
                 rivals) +
           "\nbilayer next to it, seconds on 1 and 2 threads, half width 2; OpenVDB is `meshToVolume` without "
           "renormalisation:\n\n" +
           table({"model", "dense", "double-layer, 1", "2", "exact, 1", "2", "pseudonormal, 1", "2", "OpenVDB, 1", "2"},
                 ours) +
           remarksTable2(gains, byRows, byRecursion, awpn, serial, more);
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

}  // namespace

Part table2() {
    return {"table2", "Table 2: one core", measureTable2, textTable2, behindTable2};
}

}  // namespace bilayer::paper
