// SPDX-License-Identifier: Apache-2.0
// The OpenVDB grids of a LevelSet. Include this only where grids are accessed: it adds seconds of compile time.
// Tested by tests/sdf/build.cpp.
#pragma once

#include <openvdb/openvdb.h>

#include <filesystem>

#include <bilayer/sdf/level_set.h>

namespace bilayer {

/// The OpenVDB grids that a LevelSet holds.
struct Grids {
    /// GRID_LEVEL_SET, in world units. Background: +exterior width. Inactive voxels inside: -interior width.
    openvdb::FloatGrid::ConstPtr distance;
    /// Index of the nearest triangle at each active voxel of `distance`; null unless requested.
    openvdb::Int32Grid::ConstPtr triangle;
    /// Surface points of a collider (collider/collider.h); null for a field without them.
    openvdb::GridBase::ConstPtr points = nullptr;
    /// Of the build that made the field; zeros for a field from a file.
    BuildTimes times{};
};

/// Grid name of a collider's surface points.
inline constexpr const char* contactPoints = "contact_points";

/// Names of the metadata on the distance grid. `interiorWidth` stores the interior width, since the background gives
/// only the exterior width.
namespace metadata {
inline constexpr const char* method = "bilayer:method";                 ///< LevelSet::method()
inline constexpr const char* sign = "bilayer:sign";                     ///< LevelSet::sign()
inline constexpr const char* signReason = "bilayer:sign_reason";        ///< LevelSet::signReason()
inline constexpr const char* signConflicts = "bilayer:sign_conflicts";  ///< LevelSet::signConflicts()
inline constexpr const char* signUndecided = "bilayer:sign_undecided";  ///< LevelSet::signUndecided()
inline constexpr const char* errorBound = "bilayer:error_bound";        ///< LevelSet::errorBound() [m]
inline constexpr const char* meshHash = "bilayer:mesh_hash";            ///< LevelSet::meshHash()
inline constexpr const char* interiorWidth = "bilayer:interior_width";  ///< LevelSet::interiorWidth() [m]
/// Mesh::origin, if not zero. The transforms of grids in files include it as a shift; those in memory do not.
inline constexpr const char* origin = "bilayer:origin";
inline constexpr const char* version = "bilayer:version";  ///< of bilayer, which wrote the field
}  // namespace metadata

/// Returns a grid of a level set with the origin in its transform, as in files. The tree is shared.
openvdb::GridBase::Ptr inWorld(const openvdb::GridBase::ConstPtr& grid, const LevelSet& levelSet);

/// Writes grids with distinct names to a .vdb file; an error leaves no partial file. Throws std::runtime_error that
/// names the file if it cannot be written. For a LevelSet, use writeVdb() in vdb_io.h.
void writeGrids(const std::filesystem::path& path, const openvdb::GridCPtrVec& grids);

}  // namespace bilayer
