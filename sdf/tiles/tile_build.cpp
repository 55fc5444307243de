// SPDX-License-Identifier: Apache-2.0
#include "sdf/tiles/tile_build.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

#include "sdf/base/openvdb.h"
#include "sdf/grid/field_build.h"
#include "sdf/grid/vdb_grids.h"
#include "sdf/leaf/build_options.h"
#include "sdf/leaf/build_size.h"

namespace bilayer::detail {
namespace {

/// Memory of a process that holds no tile: the program, its libraries, and the counters of all bricks [bytes].
constexpr double bytesOfProcess = 160e6;
/// Memory per triangle: as read, as a mesh, in bins, and in the cells of bricks [bytes].
constexpr double tileBytesPerTriangle = 240;
/// Memory per column of voxels: the tile's own sum, the one below, and one of another tile [bytes].
constexpr double bytesPerColumn = 12;
/// Memory per block: a leaf, its place in the tree, its compressed form, and the bytes of the file [bytes].
constexpr double tileBytesPerBlock = 5000;
/// The same for a flood: what it keeps of a leaf and of its parts, and the copies of leaves on borders [bytes].
constexpr double floodBytesPerBlock = 2000;
/// Memory of a flood per block of the tile's box, leaf or not: its set and its leaf [bytes].
constexpr double floodBytesPerBoxBlock = 9;

}  // namespace

Mesh meshOf(std::span<const TileTriangle> triangles, const glm::dvec3& origin) {
    Mesh mesh;
    mesh.origin = origin;
    mesh.points.reserve(3 * triangles.size());
    mesh.triangles.reserve(triangles.size());
    for (const TileTriangle& t : triangles) {
        mesh.triangles.push_back(unsigned(mesh.points.size()) + glm::uvec3(0, 1, 2));
        mesh.points.insert(mesh.points.end(), t.corners, t.corners + 3);
    }
    return mesh;
}

BuiltTile buildTile(std::span<const TileTriangle> triangles, const MeshFacts& facts, const Tiling& tiling,
                    std::size_t tile, const BuildOptions& options, const PartSigns& signs) {
    if (triangles.empty()) return {};
    std::vector<std::uint32_t> numbers(triangles.size());
    std::transform(triangles.begin(), triangles.end(), numbers.begin(), [](const auto& t) { return t.number; });
    const Mesh mesh = meshOf(triangles, facts.origin);
    const FieldPart part{facts.box, facts.hash, tiling.lattice(), tiling.own(tile), numbers, signs};
    FilledPart filled = buildPart(mesh, options, part);
    if (filled.conflicts > 0 && signs.check != NormalsCheck::count)
        throw std::invalid_argument(fmt::format(
            "the normals contradict each other at {} places of one tile, and only the whole mesh can decide the sides: "
            "take the sign auto, or flood for an open mesh, or build this field in one piece",
            filled.conflicts));
    const SignCounts counts{filled.conflicts, filled.compared};
    if (filled.grids->distance->tree().leafCount() == 0) return {nullptr, {}, nullptr, counts};
    const openvdb::FloatGrid::Ptr border = openvdb::FloatGrid::create(filled.border);
    border->setName(borderGrid);
    border->setTransform(filled.grids->distance->transform().copy());
    return {std::move(filled.grids), filled.faces, border, counts};
}

double tileBytes(std::uint64_t triangles, double area, const Tiling& tiling, std::size_t tile,
                 const BuildOptions& options) {
    const TriangleLimits limits = tiling.limits(tile);
    const glm::dvec3 side = limits.upper - limits.lower;
    const double boxBlocks = side.x * side.y * side.z / blockVoxels;
    const double blocks = std::min(boxBlocks, blocksAround(area, double(tiling.reach())));
    return bytesOfProcess + side.x * side.y * bytesPerColumn + double(triangles) * tileBytesPerTriangle +
           blocks * tileBytesPerBlock * (options.triangles ? 2 : 1) +
           (options.sign == Sign::flood ? blocks * floodBytesPerBlock + boxBlocks * floodBytesPerBoxBlock : 0);
}

}  // namespace bilayer::detail
