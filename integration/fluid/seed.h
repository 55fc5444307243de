// A liquid that starts from a mesh or a field, on OpenVDB's own tools.
#pragma once

#include <openvdb/openvdb.h>

#include <cstddef>
#include <glm/vec3.hpp>

#include <bilayer/integration/fluid/placement.h>
#include <bilayer/sdf/level_set.h>
#include <bilayer/sdf/mesh.h>

namespace bilayer::fluid {

enum class SeedMode { unite, intersect, subtract };

struct SeedOptions {
    SeedMode mode = SeedMode::unite;  ///< with the liquid that is there
    /// Solids of the mesh that overlap are one: walls inside of their union are no surface (BuildOptions::unite).
    bool uniteSolids = true;

    SeedOptions(SeedMode how = SeedMode::unite, bool solids = true) : mode(how), uniteSolids(solids) {}
};

/// How far distances were changed to make a level set of them.
struct SeedReport {
    float largestChange = 0;        ///< [voxels]; voxels count that were in the band and still are
    glm::dvec3 where{0};            ///< the centre of the voxel with the largest change [m]
    std::size_t changedVoxels = 0;  ///< voxels that changed by more than a tenth of a voxel
};

/// Combines a body with the caller's level set, whose voxel size and background stay as they are, bit for bit. The
/// result is a true level set again: openvdb::tools::checkLevelSet finds nothing in it. (It finds a background "less
/// than 3 voxel units" where the caller's is so by its last bit: that of createLevelSet(0.02, 3) is.) Distances from
/// the mesh are exact (regrid.h); where bodies meet they are OpenVDB's CSG's, and next to creases, walls and gaps below
/// a voxel they are changed by parts of it where that check asks for it, as the report tells. The grid gets a new tree:
/// accessors and tree pointers from before go on seeing the old one. Throws std::invalid_argument if the grid is no
/// level set, its voxels are no cubes, its band is narrower than 3 voxels, and what regrid() refuses;
/// std::runtime_error if no level set of this voxel size could be made. The grid is then untouched.
SeedReport seed(openvdb::FloatGrid& liquid, const Mesh& mesh, const Placement& placement = {},
                const SeedOptions& options = {});

/// The same with a field, whose band may be narrower than the liquid's. A mesh at hand is the better source: what a
/// field's voxels do not tell is lost.
SeedReport seed(openvdb::FloatGrid& liquid, const LevelSet& field, const Placement& placement = {},
                const SeedOptions& options = {});

}  // namespace bilayer::fluid
