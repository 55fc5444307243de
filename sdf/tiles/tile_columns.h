// SPDX-License-Identifier: Apache-2.0
// The winding numbers below a tile of a closed mesh. Each tile sums the crossings of its columns of voxels within its
// own box. The sums of the tiles below are what another tile needs of all their triangles.
// Tested by tests/sdf/tile_signs.cpp.
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <span>

#include "sdf/sign/column_sums.h"
#include "sdf/tiles/tile_build.h"
#include "sdf/tiles/tiling.h"

namespace bilayer::detail {

/// Returns the sums of the crossings in a tile's own box. Every crossing of the mesh counts in one tile.
/// @param triangles  those that Tiling::forEachTileOf() gives the tile
/// Throws std::invalid_argument that names a triangle so steep that rounding may move a crossing to another tile.
ColumnSums crossingsOf(std::span<const TileTriangle> triangles, const Tiling& tiling, std::size_t tile,
                       float voxelSize);

/// Returns the sums of all crossings below a tile, of the columns of all blocks that it fills.
/// @param sumsOf  returns crossingsOf() another tile
ColumnSums crossingsBelow(const Tiling& tiling, std::size_t tile, const std::function<ColumnSums(std::size_t)>& sumsOf);

/// Writes sums, without the rows and columns of zeros around them. Throws std::runtime_error that names the file.
void writeColumnSums(const std::filesystem::path& path, const ColumnSums& sums);

/// Reads what writeColumnSums() wrote. Throws std::runtime_error that names the file if it is missing or damaged.
ColumnSums readColumnSums(const std::filesystem::path& path);

}  // namespace bilayer::detail
