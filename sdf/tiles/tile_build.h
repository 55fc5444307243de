// SPDX-License-Identifier: Apache-2.0
// Builds one tile of a field from the triangles near it.
// Tested by tests/sdf/field_tiles.cpp.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <span>

#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/options.h>
#include "sdf/grid/field_part.h"
#include "sdf/tiles/tiling.h"

namespace bilayer::detail {

/// A triangle as tiles store it.
struct TileTriangle {
    std::uint32_t number;  ///< in the whole mesh
    glm::vec3 corners[3];  ///< [m]
};
static_assert(sizeof(TileTriangle) == 40, "files of triangles have no gaps");

/// Properties of the whole mesh that a tile needs.
struct MeshFacts {
    Bounds box;
    glm::dvec3 origin{0};
    std::uint64_t hash = 0;  ///< 0: not known
    std::uint64_t triangles = 0;
};

/// What a tile reports of its signs by normals, if it checks them.
struct SignCounts {
    std::size_t conflicts = 0;  ///< places where normals contradict each other
    ComparedSigns compared{};
};

struct BuiltTile {
    /// Grids with the whole field's values in the tile's box; elsewhere with the exterior background. Blocks
    /// without a voxel in the band are leaves if the whole field needs them for its signs. Null if no leaf is in the
    /// box.
    std::shared_ptr<Grids> grids;
    FaceSides faces{};  ///< without a grid, none
    /// The voxels above the tile's box that the cells of its last blocks need. All others are space. Null if `grids`
    /// is.
    openvdb::FloatGrid::Ptr border;
    SignCounts counts{};
    /// With signs by flood: whether all of a tile without grids is inside.
    bool inside = false;
};

/// Returns the mesh of some triangles.
Mesh meshOf(std::span<const TileTriangle> triangles, const glm::dvec3& origin);

/// Builds a tile. Its bytes are those of the whole field, but for signs by flood: all distances are then positive, and
/// FloodTile signs them.
/// @param triangles  those that Tiling::forEachTileOf() gives the tile, in the order of the mesh
/// @param options    valid and local
/// @param signs      of all tiles, for Method::exact
/// Throws as build() does. Throws std::invalid_argument if only the whole mesh can decide a sign: where the normals
/// cancel out, or contradict each other and are not counted.
BuiltTile buildTile(std::span<const TileTriangle> triangles, const MeshFacts& mesh, const Tiling& tiling,
                    std::size_t tile, const BuildOptions& options, const PartSigns& signs = {});

/// Returns about how much memory a tile needs [bytes].
/// @param area  of the tile's triangles within its limits [voxels^2]
double tileBytes(std::uint64_t triangles, double area, const Tiling& tiling, std::size_t tile,
                 const BuildOptions& options);

}  // namespace bilayer::detail
