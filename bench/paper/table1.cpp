// SPDX-License-Identifier: Apache-2.0
// Table 1: errors of the double layer method.
#include <fmt/format.h>
#include <algorithm>
#include <cmath>

#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/inspect.h>
#include "bench/measure.h"
#include "bench/paper/errors.h"
#include "bench/paper/markdown.h"
#include "bench/paper/models.h"
#include "bench/paper/part.h"
#include "bench/paper/published.h"
#include "bench/paper/scatter.h"
#include "demos/shared/shapes.h"
#include "sdf/base/openvdb.h"

namespace bilayer::paper {
namespace {

using bench::logSlope;
using nlohmann::json;

json measureTable1(const Run& run) {
    const auto bunny = findModel("bunny", run.meshes);
    if (!bunny) return {{"skipped", "no bunny"}};
    json rows = json::array();
    for (const published::Error& paper : published::table1) {
        const Lattice lattice = latticeOf(paper.nodes);
        const Mesh mesh = fitted(bunny->mesh, lattice);
        const DenseField layers = denseDoubleLayer(mesh, lattice);
        json row{
            {"nodes", paper.nodes},
            {"step", lattice.step},
            {"perEpsilon", double(layers.samples) * double(lattice.step) * double(lattice.step) / inspect(mesh).area}};
        {
            const DenseField truth = scatterPseudonormal(mesh, lattice, reached);
            row["all"] = errors(layers, truth, noLimit).toJson();
            row["near"] = errors(layers, truth, papersBand).toJson();
            row["blocks"] = errors(build(mesh, optionsFor(lattice, Method::doubleLayer, 2)), truth).toJson();
            row["exact"] = errors(build(mesh, optionsFor(lattice, Method::exact, 3)), truth).toJson();
        }
        const Mesh half = shapes::moved(mesh, glm::vec3(lattice.step / 2));
        row["halfCell"] = errors(layers, scatterPseudonormal(half, lattice, reached), noLimit).toJson();
        rows.push_back(row);
    }
    return {{"rows", rows}, {"triangles", bunny->mesh.triangles.size()}, {"origin", bunny->origin}};
}

// Order of convergence: the power of the step with which an error falls; "-" if the error does not fall from grid to
// grid.
std::string order(const std::vector<double>& steps, const std::vector<double>& errors) {
    if (!std::is_sorted(errors.rbegin(), errors.rend())) return "-";
    return fmt::format("{:.2f}", logSlope(steps, errors));
}

std::string order(const json& rows, const char* which, const char* norm) {
    std::vector<double> steps, values;
    for (const json& row : rows) {
        steps.push_back(row["step"]);
        values.push_back(double(row[which][norm]) * double(row["step"]));
    }
    return order(steps, values);
}

std::string papersOrder(double published::Error::*norm) {
    std::vector<double> steps, values;
    for (const published::Error& row : published::table1) {
        steps.push_back(row.step);
        values.push_back(row.*norm);
    }
    return order(steps, values);
}

// Lists numbers of rows as "6.9, 2.1, 1.47 and 0.83"; empty if a row lacks the number.
std::string listed(const json& rows, const char* what) {
    std::string text;
    for (std::size_t i = 0; i < rows.size(); ++i) {
        if (!rows[i].contains(what)) return "";
        text += (i == 0 ? "" : i + 1 < rows.size() ? ", " : " and ") + digits(rows[i][what], 2);
    }
    return text;
}

std::string textTable1(const json& data) {
    std::vector<std::vector<std::string>> metres, inSteps;
    double smallest = 1e9, largest = 0;
    for (std::size_t i = 0; i < published::table1.size(); ++i) {
        const published::Error& paper = published::table1[i];
        const json& row = data["rows"][i];
        const double step = row["step"];
        metres.push_back({fmt::format("{}^3", paper.nodes), fmt::format("{} / {}", paper.step, digits(step)),
                          fmt::format("{:.5f}", paper.worst), fmt::format("{:.5f}", double(row["all"]["worst"]) * step),
                          fmt::format("{:.5f}", paper.mean), fmt::format("{:.5f}", double(row["all"]["mean"]) * step),
                          fmt::format("{:.5f}", double(row["blocks"]["worst"]) * step),
                          fmt::format("{:.5f}", double(row["blocks"]["mean"]) * step),
                          digits(double(row["exact"]["worst"]) * step, 2)});
        const auto pair = [&](const char* which) {
            return fmt::format("{:.2f} / {:.3f}", double(row[which]["worst"]), double(row[which]["mean"]));
        };
        inSteps.push_back({fmt::format("{}^3", paper.nodes),
                           fmt::format("{:.2f} / {:.3f}", paper.worst / paper.step, paper.mean / paper.step),
                           pair("all"), pair("near"), pair("halfCell"), pair("blocks"),
                           fmt::format("{} / {}", digits(row["exact"]["worst"], 2), digits(row["exact"]["mean"], 2)),
                           fmt::format("{}", row["all"]["signs"].get<std::uint64_t>())});
        smallest = std::min(smallest, paper.mean / paper.step);
        largest = std::max(largest, paper.mean / paper.step);
    }
    metres.push_back({"order", "", papersOrder(&published::Error::worst), order(data["rows"], "all", "worst"),
                      papersOrder(&published::Error::mean), order(data["rows"], "all", "mean"),
                      order(data["rows"], "blocks", "worst"), order(data["rows"], "blocks", "mean"),
                      order(data["rows"], "exact", "worst")});
    std::string text = fmt::format(
        "The bunny here is {}, with {} triangles. Errors are by Eq. 4 against angle-weighted pseudonormals, in the "
        "mesh's unit.\n\n"
        "- *Dense*: the paper's serial program (`bench/paper/dense.cpp`), over all nodes that it reaches.\n"
        "- *Blocks*: bilayer's `double-layer`, half width 2. *Exact*: its `exact`, half width 3.\n"
        "- *Order*: the power of the step with which the error falls; \"-\" where it does not fall from each grid to "
        "the next.\n\n",
        data["origin"].get<std::string>(), data["triangles"].get<int>());
    text += table({"grid", "step, paper / here", "e_max, paper", "dense", "e_avg, paper", "dense", "blocks, e_max",
                   "blocks, e_avg", "exact, e_max"},
                  metres);
    text += "\nThe same in steps, e_max / e_avg:\n\n";
    text += table({"grid", "paper", "dense", "dense, nodes within 2 steps", "dense, offset by half a cell", "blocks",
                   "exact", "wrong signs, dense"},
                  inSteps);
    const auto steps = [&](std::size_t i, const char* which, const char* norm) {
        return double(data["rows"][i][which][norm]);
    };
    const std::size_t last = published::table1.size() - 1;
    const auto smaller = [&](std::size_t i) {  // the mean error in the mesh's unit
        return published::table1[i].mean / (steps(i, "all", "mean") * double(data["rows"][i]["step"]));
    };
    double minRatio = 1e9, maxRatio = 0;  // range of the block-wise method's worst error over the paper's, in steps
    for (std::size_t i = 0; i <= last; ++i) {
        const double ratio = steps(i, "blocks", "worst") / (published::table1[i].worst / published::table1[i].step);
        minRatio = std::min(minRatio, ratio);
        maxRatio = std::max(maxRatio, ratio);
    }
    const std::string perEpsilon = listed(data["rows"], "perEpsilon");
    return text +
           fmt::format(
               "\nThe mean error here, in the mesh's unit, is {:.1f} times smaller than the paper's at {} nodes and "
               "{:.1f} times at {}.\n\n"
               "- **Samples.** Algorithm 1 rounds the number of rows up: a triangle smaller than epsilon has one "
               "sample, one hardly larger has three. So coarser grids have denser samples{}.\n"
               "- **Order.** The error therefore falls more slowly than the step (order {}). It would fall as the step "
               "does if triangles had many rows, and 1/2 sample for an epsilon of surface.\n"
               "- **Worst nodes.** Those of *dense* have the wrong sign, or are at the rim of what it reaches. There a "
               "node may know one layer well and the other one hardly.\n"
               "- **e_max.** The paper does not say over which nodes it takes it. Over all that *dense* reaches it is "
               "larger.\n"
               "- **Blocks.** bilayer's default has more samples, and a band that is trimmed to its width. Its worst "
               "errors, in steps, are {:.2f} to {:.2f} times the paper's.\n"
               "- **Exact.** It is off where a node is within 1e-4 steps of the surface, and its sign may be either.\n"
               "\nThe paper's method does not explain its means: they are {:.2f} to {:.2f} steps, where *dense* has "
               "{:.3f} to {:.3f}. Two fields half a cell apart along each axis, as values at nodes and at centres of "
               "cells are, have a mean of that size: sqrt(3) / 4 = {:.2f} for normals of all directions (the column "
               "*offset by half a cell*). That is a guess. The step printed for {} nodes does not fit the others: "
               "{} / {} is {:.3f}.\n",
               smaller(0), published::table1[0].nodes, smaller(last), published::table1[last].nodes,
               perEpsilon.empty() ? "" : fmt::format(", {} for an epsilon of surface on these grids", perEpsilon),
               order(data["rows"], "all", "mean"), minRatio, maxRatio, smallest, largest, steps(0, "all", "mean"),
               steps(last, "all", "mean"), std::sqrt(3.0) / 4, published::table1[0].nodes, boxSide,
               published::table1[0].nodes - 1, boxSide / (published::table1[0].nodes - 1));
}

std::vector<std::string> behindTable1(const json& data) {
    std::vector<std::string> found;
    for (std::size_t i = 0; i < published::table1.size(); ++i) {
        const published::Error& paper = published::table1[i];
        const double papers = paper.worst / paper.step, ours = data["rows"][i]["blocks"]["worst"];
        if (ours > papers)
            found.push_back(
                fmt::format("Table 1, {}^3: `double-layer` is off by {:.2f} steps at worst, the paper by {:.2f}.",
                            paper.nodes, ours, papers));
    }
    return found;
}

}  // namespace

Part table1() {
    return {"table1", "Table 1: errors", measureTable1, textTable1, behindTable1};
}

}  // namespace bilayer::paper
