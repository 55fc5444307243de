// SPDX-License-Identifier: Apache-2.0
// The fields of the serial program and of the block-wise method are the same.
#include <fmt/format.h>
#include <algorithm>
#include <cmath>

#include <bilayer/sdf/grids.h>
#include "bench/paper/errors.h"
#include "bench/paper/markdown.h"
#include "bench/paper/models.h"
#include "bench/paper/part.h"
#include "bench/paper/scatter.h"
#include "sdf/base/openvdb.h"

namespace bilayer::paper {
namespace {

using nlohmann::json;

// Differences between the fields of the serial program and of the block-wise method.
struct Difference {
    double worst = 0;             // maximum difference of nodes that count as equal [steps]
    std::uint64_t reached = 0;    // nodes
    std::uint64_t halfway = 0;    // that depend on how a sample half-way between two nodes is rounded
    std::uint64_t ties = 0;       // with equally near layers and opposite signs
    std::uint64_t different = 0;  // without such a reason
    std::uint64_t far = 0, farWrong = 0, farWrongBlocks = 0;  // without a distance in either field, and on the wrong
                                                              // side
};

constexpr float wholeCube = 5;  // half width that trims no node of a cube of 5^3 around a sample [steps]
// Blocks round halves up from slightly below. Samples this close to that threshold may round either way.
constexpr float halvesUp = 0.5001f, halfError = 5e-5f;
constexpr float tieWidth = 0.02f;  // on both sides of zero [steps]
constexpr double rounding = 1e-3;  // tolerance of floats on a grid of hundreds of steps [steps]

// Value of a node: a distance [steps], or only a side where the distance is unknown.
struct Node {
    bool known;
    double phi;

    double difference(const Node& other) const {
        if (known != other.known) return farAway;
        return known ? std::abs(phi - other.phi) : 0;
    }
    bool tie(const Node& other) const {
        return known && other.known && phi * other.phi <= 0 && std::abs(std::abs(phi) - std::abs(other.phi)) < tieWidth;
    }
};

void compare(const Node& low, const Node& high, const Node& blocks, bool inside, Difference& result) {
    const double nearest = std::min(blocks.difference(low), blocks.difference(high));
    result.reached += blocks.known;
    result.halfway += low.difference(high) > 0;
    if (nearest <= rounding)
        result.worst = std::max(result.worst, nearest);
    else
        ++(blocks.tie(low) || blocks.tie(high) ? result.ties : result.different);
    if (blocks.known || low.known) return;
    ++result.far;
    result.farWrong += (low.phi < 0) != inside;
    result.farWrongBlocks += (blocks.phi < 0) != inside;
}

Difference differenceOf(const Mesh& mesh, const Lattice& lattice, Subdivision subdivision, const DenseField& truth) {
    BuildOptions options = optionsFor(lattice, Method::doubleLayer, wholeCube);
    options.doubleLayer.subdivision = subdivision;
    options.doubleLayer.fillGaps = false;
    const LevelSet blocks = build(mesh, options);
    const auto values = blocks.grids().distance->getConstAccessor();
    const auto serial = [&](float half) {
        return denseDoubleLayer(mesh, lattice, {.subdivision = subdivision, .half = half});
    };
    const DenseField low = serial(halvesUp - halfError), high = serial(halvesUp + halfError);
    const auto node = [&](const DenseField& field, std::size_t index) {
        return Node{finite(field.phi[index]), double(field.phi[index] / lattice.step)};
    };
    Difference result;
    for (int i = 0; i < lattice.nodes.x; ++i)
        for (int j = 0; j < lattice.nodes.y; ++j)
            for (int k = 0; k < lattice.nodes.z; ++k) {
                const openvdb::Coord at(i, j, k);
                const std::size_t index = lattice.index(i, j, k);
                const Node block{values.isValueOn(at), double(values.getValue(at) / lattice.step)};
                compare(node(low, index), node(high, index), block, truth.phi[index] < 0, result);
            }
    return result;
}

json measureSame(const Run& run) {
    json rows = json::array();
    for (const char* name : {"bunny", "dragon"}) {
        const auto model = findModel(name, run.meshes);
        if (!model) continue;
        const Lattice lattice = latticeOf(251);
        const Mesh mesh = fitted(model->mesh, lattice);
        const DenseField truth = scatterPseudonormal(mesh, lattice, papersBand);
        for (const Subdivision subdivision : {Subdivision::rows, Subdivision::recursive}) {
            const Difference found = differenceOf(mesh, lattice, subdivision, truth);
            rows.push_back({{"model", name},
                            {"recursive", subdivision == Subdivision::recursive},
                            {"worst", found.worst},
                            {"reached", found.reached},
                            {"halfWay", found.halfway},
                            {"different", found.different},
                            {"ties", found.ties},
                            {"far", found.far},
                            {"farWrong", found.farWrong},
                            {"farWrongBlocks", found.farWrongBlocks}});
        }
    }
    return rows.empty() ? json{{"skipped", "no model"}} : json{{"rows", rows}};
}

std::string textSame(const json& data) {
    std::vector<std::vector<std::string>> rows;
    std::uint64_t different = 0;
    bool dragon = false;
    for (const json& row : data["rows"]) {
        different += row["different"].get<std::uint64_t>();
        dragon = dragon || row["model"] == "dragon";
        const auto count = [&](const char* what) { return fmt::format("{}", row[what].get<std::uint64_t>()); };
        rows.push_back({row["model"], row["recursive"] ? "recursive (Fig. 2)" : "Algorithm 1", count("reached"),
                        digits(row["worst"], 2), count("halfWay"), count("ties"), count("different"), count("far"),
                        count("farWrong") + " / " + count("farWrongBlocks")});
    }
    return "bilayer fills blocks of 8x8x8 voxels in parallel, from samples sorted by cells, in floats around the "
           "block. "
           "The paper's program walks over triangles and keeps dense grids (`bench/paper/dense.cpp`). With "
           "`DoubleLayerOptions::fillGaps = false` and a half width that trims nothing, " +
           (different ? fmt::format("their fields differ at {} nodes for no reason named below", different)
                      : std::string("both give the same distances and signs at all nodes reached")) +
           ", at 251^3:\n\n" +
           table({"model", "subdivision", "nodes reached", "max difference [steps]", "half-way nodes", "ties",
                  "other differences", "far nodes", "of the wrong sign, serial / blocks"},
                 rows) +
           "\n- **Half-way nodes** are at the rim of the cube around a sample that is half-way between two nodes, up "
           "to "
           "rounding. The sample may update the cube around either node, and the field is that of one of the two.\n"
           "- **Ties** are nodes that both layers are equally near to, up to rounding, with the other sign.\n"
           "- **Far nodes** have the sign that a scan along z, or OpenVDB's flood, carries from the nearest known one, "
           "right or wrong." +
           (dragon ? " The dragon self-intersects, and its pseudonormals, which judge here, contradict each other "
                     "there."
                   : "") +
           "\n\nBy default bilayer's field differs on purpose, for reasons that [method.md](method.md) gives:\n\n"
           "- Every sample reaches as far as the band asks, and the band is trimmed to its width.\n"
           "- Triangles that need more than n_max rows are quartered.\n"
           "- Long slivers get a row of samples along them.\n\n"
           "As in Algorithm 1, only upright parts of a triangle have a sample.\n";
}

}  // namespace

Part same() {
    return {"same", "The serial program and the blocks", measureSame, textSame};
}

}  // namespace bilayer::paper
