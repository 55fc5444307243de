// SPDX-License-Identifier: Apache-2.0
// Marker particles of a liquid.
#pragma once

#include <openvdb/openvdb.h>
#include <openvdb/points/PointDataGrid.h>

#include <cstdint>
#include <functional>
#include <glm/vec3.hpp>
#include <vector>

#include <bilayer/collider/field.h>
#include <bilayer/integration/fluid/seed.h>

namespace bilayer::fluid {

/// Options of particles().
struct ParticleOptions {
    int perVoxel = 8;        ///< particles in a voxel that is entirely inside, in 1..1000
    std::uint64_t seed = 0;  ///< the same seed gives the same particles, for any number of threads
    /// As BuildOptions::progress, of the blocks of 8^3 voxels.
    std::function<bool(float)> progress{};
    /// The liquid's velocity at a point [m -> m/s], called from any thread; none: particles have no velocities.
    std::function<glm::vec3(const glm::vec3& point)> velocity{};
};

/// What particles() returns.
struct Particles {
    std::vector<glm::vec3> positions;   ///< [m]
    std::vector<glm::vec3> velocities;  ///< of each particle; empty if ParticleOptions::velocity is not set [m/s]
};

/// Creates particles at jittered positions inside a level set, none outside. Throws std::invalid_argument if the grid
/// is no level set, its voxels are not cubes, or `perVoxel` is out of range; and Cancelled.
Particles particles(const openvdb::FloatGrid& liquid, const ParticleOptions& options = {});

/// Creates particles inside a body, in the voxels of a solver's grid. If the field has its mesh, no particle is on the
/// far side of a wall, however thin, even where the voxels are many times as wide. Otherwise this holds up to the
/// resolution of the field's voxels. Also throws for a placement as seed() does.
Particles particles(const Field& body, const Placement& placement, const openvdb::math::Transform& voxels,
                    const ParticleOptions& options = {});

/// Converts particles to an OpenVDB point grid, `particles`, with the attribute P and, if there are velocities, v.
openvdb::points::PointDataGrid::Ptr particleGrid(const Particles& particles, const openvdb::math::Transform& voxels);

}  // namespace bilayer::fluid
