// SPDX-License-Identifier: Apache-2.0
// The grids of a field in a .vdb file, without the checks that only whole fields pass.
// Tested by tests/sdf/vdb_io.cpp through readVdb().
#pragma once

#include <filesystem>
#include <glm/vec3.hpp>
#include <memory>

#include <bilayer/sdf/grids.h>

namespace bilayer::detail {

/// Reads the grids of a field, relative to the origin of its mesh. Throws std::runtime_error that names the file if it
/// is damaged or holds no level set.
std::shared_ptr<Grids> readGrids(const std::filesystem::path& path);

/// The name of a tile's grid with the voxels above its box.
inline constexpr const char* borderGrid = "border";

/// What the file of a tile holds.
struct TileGrids {
    std::shared_ptr<Grids> grids;
    openvdb::FloatGrid::ConstPtr border;  ///< BuiltTile::border
};

/// Reads a tile. Throws as readGrids() does, and std::runtime_error that names the file if it has no border.
TileGrids readTile(const std::filesystem::path& path);

/// Adds the values of the border above a tile to those of the tile.
void addBorder(openvdb::FloatTree& tile, const openvdb::FloatTree& border);

/// Returns a grid whose transform has the origin of the mesh, as in files. The tree is shared. Throws
/// std::invalid_argument if the grid is so far from zero that a file would round its voxels.
openvdb::GridBase::Ptr withOrigin(const openvdb::GridBase::ConstPtr& grid, const glm::dvec3& origin);

}  // namespace bilayer::detail
