// A liquid that starts from a mesh or a field, on OpenVDB's own tools.
#pragma once

#include <openvdb/openvdb.h>

#include "integration/fluid/placement.h"
#include "sdf/level_set.h"
#include "sdf/mesh.h"

namespace bilayer::fluid {

enum class SeedMode { unite, intersect, subtract };

/// Combines a body with the caller's level set, whose voxel size and half width stay as they are. The result is a true
/// level set again: openvdb::tools::checkLevelSet finds nothing in it. Distances from the mesh are exact (regrid.h);
/// where bodies meet they are OpenVDB's CSG's, and next to creases, walls and gaps below a voxel they are changed by
/// parts of it where that check asks for it; where it asks for much, the whole band is normalized. The grid gets a new
/// tree: accessors and tree pointers from before go on seeing the old one. Throws std::invalid_argument if the grid is
/// no level set, its voxels are no cubes, its band is narrower than 3 voxels, and what regrid() refuses;
/// std::runtime_error if no level set of this voxel size could be made. The grid is then untouched.
void seed(openvdb::FloatGrid& liquid, const Mesh& mesh, const Placement& placement = {},
          SeedMode mode = SeedMode::unite);

/// The same with a field, whose band may be narrower than the liquid's. A mesh at hand is the better source: what a
/// field's voxels do not tell is lost.
void seed(openvdb::FloatGrid& liquid, const LevelSet& field, const Placement& placement = {},
          SeedMode mode = SeedMode::unite);

}  // namespace bilayer::fluid
