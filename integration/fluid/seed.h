// A liquid that starts from a mesh's field, on OpenVDB's own tools.
#pragma once

#include <openvdb/openvdb.h>

#include "collider/pose.h"
#include "sdf/level_set.h"

namespace bilayer::fluid {

enum class SeedMode { unite, intersect, subtract };

/// Combines a field, moved by a pose, with the caller's level set, whose voxel size and half width stay as they are. The
/// result is a true level set again: openvdb::tools::checkLevelSet finds nothing in it.
/// Throws std::invalid_argument, and leaves the grid untouched, if it is no level set, its voxels are not cubes, its band
/// is narrower than 3 voxels, or the pose is not finite or its rotation not of unit length.
void seed(openvdb::FloatGrid& liquid, const LevelSet& field, const Pose& pose = {}, SeedMode mode = SeedMode::unite);

}  // namespace bilayer::fluid
