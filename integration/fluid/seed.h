// A liquid that starts from a mesh's field, on OpenVDB's own tools.
#pragma once

#include <openvdb/openvdb.h>

#include "collider/pose.h"
#include "sdf/level_set.h"

namespace bilayer::fluid {

enum class SeedMode { unite, intersect, subtract };

/// Combines a field, moved by a pose, with the caller's level set, whose voxel size and half width stay as they are.
/// The result is a true level set again: openvdb::tools::checkLevelSet finds nothing in it. Where the field's band is
/// narrower than the liquid's, distances are swept (first order); features below a voxel of the liquid may be rounded
/// off. The grid gets a new tree: accessors and tree pointers from before go on seeing the old one. Throws
/// std::invalid_argument if the grid is no level set, its voxels are not cubes, its band is narrower than 3 voxels, the
/// field's is narrower than one, or the pose is not finite, out of range, or its rotation not of unit length, and
/// std::runtime_error if no level set of this voxel size could be made. The grid is then untouched.
void seed(openvdb::FloatGrid& liquid, const LevelSet& field, const Pose& pose = {}, SeedMode mode = SeedMode::unite);

}  // namespace bilayer::fluid
