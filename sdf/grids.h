// The OpenVDB grids inside a LevelSet. Include this only where grids are touched: it costs seconds of compile time.
#pragma once

#include <openvdb/openvdb.h>

#include <filesystem>

#include <bilayer/sdf/level_set.h>

namespace bilayer {

struct Grids {
    /// GRID_LEVEL_SET; world units; background = exterior width, inactive inside = -interior width.
    openvdb::FloatGrid::ConstPtr distance;
    /// Index of the nearest triangle at each active voxel of `distance`; null unless asked for.
    openvdb::Int32Grid::ConstPtr triangle;
    /// The surface points of a body (collider/body.h); null for a field alone.
    openvdb::GridBase::ConstPtr points = nullptr;
};

/// Name of the grid of a body's surface points.
inline constexpr const char* contactPoints = "contact_points";

/// Names of the metadata that bilayer writes on the distance grid. `inside_width` is there for fields whose interior
/// width differs from the background.
namespace metadata {
inline constexpr const char* method = "bilayer:method";
inline constexpr const char* sign = "bilayer:sign";
inline constexpr const char* signReason = "bilayer:sign_reason";
inline constexpr const char* signConflicts = "bilayer:sign_conflicts";
inline constexpr const char* signUndecided = "bilayer:sign_undecided";
inline constexpr const char* errorBound = "bilayer:error_bound";
inline constexpr const char* meshHash = "bilayer:mesh_hash";
inline constexpr const char* interiorWidth = "bilayer:interior_width";
/// Mesh::origin, where it is not zero: the transforms of grids in files have it as their shift, those in memory do not.
inline constexpr const char* origin = "bilayer:origin";
inline constexpr const char* version = "bilayer:version";
}  // namespace metadata

/// A grid of a level set with its origin in its transform, as files hold it. The tree is shared.
openvdb::GridBase::Ptr inWorld(const openvdb::GridBase::ConstPtr& grid, const LevelSet& levelSet);

/// Writes any grids to a .vdb file, whole or not at all; their names differ. Throws std::runtime_error that names the
/// file when it cannot be written. writeVdb() in vdb_io.h does so for a LevelSet.
void writeGrids(const std::filesystem::path& path, const openvdb::GridCPtrVec& grids);

}  // namespace bilayer
