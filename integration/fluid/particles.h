// Marker particles of a liquid.
#pragma once

#include <openvdb/openvdb.h>
#include <openvdb/points/PointDataGrid.h>

#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

namespace bilayer::fluid {

struct ParticleOptions {
    int perVoxel = 8;        ///< particles in a voxel that lies inside altogether, in 1..1000
    std::uint64_t seed = 0;  ///< the same seed gives the same particles, for any number of threads
};

/// Jittered positions inside a level set, none outside [m]. Throws std::invalid_argument if the grid is no level set or
/// `perVoxel` is out of range.
std::vector<glm::vec3> particles(const openvdb::FloatGrid& liquid, const ParticleOptions& options = {});

/// Particles as an OpenVDB points grid of the liquid's voxel size.
openvdb::points::PointDataGrid::Ptr particleGrid(const openvdb::FloatGrid& liquid, const ParticleOptions& options = {});

}  // namespace bilayer::fluid
