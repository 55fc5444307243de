// SPDX-License-Identifier: Apache-2.0
// Sorts the triangles of a mesh into one file per tile, so that a tile is built without the rest of the mesh.
// Tested by tests/sdf/triangle_source.cpp.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <vector>

#include "sdf/tiles/tile_build.h"
#include "sdf/tiles/tiling.h"
#include "sdf/tiles/triangle_source.h"

namespace bilayer::detail {

/// What a tile must hold.
struct TileLoad {
    std::uint64_t triangles = 0;
    double area = 0;         ///< within the tile's limits [voxels^2]
    std::uint64_t hash = 0;  ///< of the triangles
};

/// Writes the triangles of each tile to a file, in the order of the mesh. Replaces existing files. Its buffers take at
/// most 64 MiB, or a few KiB per tile.
/// @param fileOf  the path for a tile; a tile without triangles gets no file
/// Throws std::runtime_error that names a file that cannot be written, and as the source does.
std::vector<TileLoad> sortTriangles(const TriangleSource& source, Tiling& tiling, float voxelSize,
                                    const std::function<std::filesystem::path(std::size_t)>& fileOf);

/// Reads a file that sortTriangles() wrote for this load. Throws std::runtime_error that names it if its triangles are
/// not those.
std::vector<TileTriangle> readTileTriangles(const std::filesystem::path& path, const TileLoad& load);

/// Returns whether readTileTriangles() does not throw.
bool hasTileTriangles(const std::filesystem::path& path, const TileLoad& load);

}  // namespace bilayer::detail
