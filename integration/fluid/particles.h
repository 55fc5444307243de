// Marker particles of a liquid.
#pragma once

#include <openvdb/openvdb.h>
#include <openvdb/points/PointDataGrid.h>

#include <cstdint>
#include <functional>
#include <glm/vec3.hpp>
#include <vector>

#include <bilayer/collider/field.h>
#include <bilayer/integration/fluid/placement.h>

namespace bilayer::fluid {

struct ParticleOptions {
    int perVoxel = 8;        ///< particles in a voxel that lies inside altogether, in 1..1000
    std::uint64_t seed = 0;  ///< the same seed gives the same particles, for any number of threads
    /// The liquid's velocity at a point [m -> m/s], called from any thread; none: particles have no velocities.
    std::function<glm::vec3(const glm::vec3& point)> velocity{};
};

struct Particles {
    std::vector<glm::vec3> positions;   ///< [m]
    std::vector<glm::vec3> velocities;  ///< as many, or none where none were asked for [m/s]
};

/// Jittered positions inside a level set, none outside. Throws std::invalid_argument if the grid is no level set, its
/// voxels are no cubes, or `perVoxel` is out of range.
Particles particles(const openvdb::FloatGrid& liquid, const ParticleOptions& options = {});

/// The same inside a body, in the voxels of a solver's grid: no particle is on the far side of a wall however thin,
/// even where the voxels are many times as wide, if the field has its mesh; else as far as its own voxels tell. Throws
/// as well for a placement as check() does.
Particles particles(const Field& body, const Placement& placement, const openvdb::math::Transform& voxels,
                    const ParticleOptions& options = {});

/// Particles as a grid of OpenVDB points, `particles`, with the attributes P and, if there are velocities, v.
openvdb::points::PointDataGrid::Ptr particleGrid(const Particles& particles, const openvdb::math::Transform& voxels);

}  // namespace bilayer::fluid
