// SPDX-License-Identifier: Apache-2.0
// Seeds a liquid's level set from a mesh or a field, on OpenVDB's own tools.
#pragma once

#include <openvdb/openvdb.h>

#include <cstddef>
#include <functional>
#include <glm/vec3.hpp>

#include <bilayer/collider/pose.h>
#include <bilayer/sdf/level_set.h>
#include <bilayer/sdf/mesh.h>

namespace bilayer::fluid {

/// The pose of a body in the world, after scaling along its own axes: body coordinates x become pose.toWorld(scale *
/// x).
struct Placement {
    Pose pose{};         ///< applied after the scale
    glm::vec3 scale{1};  ///< positive: a reflection would invert the body

    /// The body as it is: at the origin, not rotated and not scaled.
    Placement() = default;
    /// A pose, perhaps with a scale along each axis of the body.
    Placement(const Pose& placed, const glm::vec3& stretch = glm::vec3(1)) : pose(placed), scale(stretch) {}

    /// A point of the body in world coordinates [m].
    glm::dvec3 toWorld(const glm::dvec3& point) const {
        return glm::dquat(pose.rotation) * (glm::dvec3(scale) * point) + glm::dvec3(pose.position);
    }
};

/// The operation that combines a body with the liquid.
enum class SeedMode {
    unite,      ///< the body becomes liquid
    intersect,  ///< only the liquid inside the body remains
    subtract,   ///< the liquid inside the body goes
};

/// Options of seed().
struct SeedOptions {
    SeedMode mode = SeedMode::unite;  ///< CSG operation with the existing liquid
    /// Whether overlapping solids of the mesh are united: walls inside their union are then no surface
    /// (BuildOptions::unite).
    bool uniteSolids = true;
    /// As BuildOptions::progress, of the body's distances.
    std::function<bool(float)> progress{};

    /// A mode alone is a set of options too: seed(liquid, mesh, placement, SeedMode::subtract).
    SeedOptions(SeedMode how = SeedMode::unite, bool solids = true) : mode(how), uniteSolids(solids) {}
};

/// How far distances were changed to make the result a level set.
struct SeedReport {
    float maxChangeVoxels = 0;      ///< maximum change, over the voxels that were in the band and still are
    glm::dvec3 where{0};            ///< centre of the voxel with the maximum change [m]
    std::size_t changedVoxels = 0;  ///< voxels that changed by more than 0.1 voxels
};

/// Combines a body with the caller's level set. The grid and the placed body are in world coordinates: a body with an
/// origin is where that puts it, and the distances of a LevelSet with an origin must come from inWorld() (grids.h).
///
/// The grid's voxel size and background stay the same to the bit. It gets a new tree; accessors and tree pointers from
/// before keep referring to the old one.
///
/// The result is a true level set: openvdb::tools::checkLevelSet finds no fault in it. (One exception: it may
/// report a background "less than 3 voxel units" because the caller's background is smaller by its last bit, as that of
/// createLevelSet(0.02, 3) is.) Distances from the mesh are exact. Where bodies meet, they are those of
/// OpenVDB's CSG. Next to creases, walls and gaps below a voxel, they are changed by fractions of a voxel if that check
/// needs it; SeedReport states how far.
///
/// Throws std::invalid_argument for
/// - a grid that is no level set, whose voxels are not cubes or mirrored, or whose band is narrower than 3 voxels;
/// - a placement with a number that is not finite, a rotation that is not of unit length, or a scale below or at zero;
/// - a mesh with a hole wider than two voxels, or without an inside;
/// - a body so thin that it would lie between the voxels at some position of them;
/// - everything that build() refuses, such as a band of more memory than the machine has.
///
/// Throws std::runtime_error if no level set of this voxel size could be made, and Cancelled. The grid is then
/// unchanged.
SeedReport seed(openvdb::FloatGrid& liquid, const Mesh& mesh, const Placement& placement = {},
                const SeedOptions& options = {});

/// Combines a field, whose band may be narrower than the liquid's. Prefer the mesh where you have it: details below the
/// field's voxel size are lost.
SeedReport seed(openvdb::FloatGrid& liquid, const LevelSet& field, const Placement& placement = {},
                const SeedOptions& options = {});

}  // namespace bilayer::fluid
