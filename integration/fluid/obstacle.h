// SPDX-License-Identifier: Apache-2.0
// A moving rigid body as an obstacle in a fluid solver's grid.
#pragma once

#include <openvdb/openvdb.h>

#include <functional>

#include <bilayer/integration/fluid/seed.h>
#include <bilayer/sdf/level_set.h>
#include <bilayer/sdf/mesh.h>

namespace bilayer::fluid {

/// The velocity of a rigid body: a point x moves at linear + angular x (x - its pose's position).
struct Velocity {
    glm::vec3 linear{0};   ///< [m/s]
    glm::vec3 angular{0};  ///< [rad/s]
};

/// The obstacle data that pressure solvers need. Cells are the voxels, centred at integer index coordinates. A
/// staggered value at a cell belongs to its three lower faces, half a voxel down each axis, as in OpenVDB.
struct Solid {
    openvdb::FloatGrid::Ptr distance;  ///< `solid`: level set at the cell centres, negative inside the body [m]
    /// `solid_velocity`: the body's velocity across each face in the band [m/s]; staggered
    openvdb::Vec3SGrid::Ptr velocity;
    openvdb::Vec3SGrid::Ptr faceFluidFraction;  ///< `face_fluid_fraction`: fluid fraction of each face, 0..1; staggered
    openvdb::FloatGrid::Ptr cellFluidFraction;  ///< `cell_fluid_fraction`: fluid fraction of each cell, 0..1
};

/// Options of solid().
struct SolidOptions {
    Velocity velocity{};        ///< of the obstacle
    float halfWidthVoxels = 3;  ///< half width of `distance` and `velocity`, at least 3
    /// As BuildOptions::progress, of the distances at the cells' centres and corners.
    std::function<bool(float)> progress{};
};

/// Computes the obstacle data of a body. Fluid fractions follow from the distances at the cells' corners, linear
/// between them. They are exact for a plane, and else of second order. C. Batty, F. Bertails, R. Bridson, "A fast
/// variational framework for accurate solid-fluid coupling", 2007, weigh faces so; C. Min, F. Gibou, "Geometric
/// integration over arbitrary domains", 2007, cut cells into tetrahedra. A plate thinner than a cell may lie between
/// corners: there it closes no face.
///
/// Active are the cells whose fluid fraction is below 1. Throws std::invalid_argument as seed() does for a mesh or a
/// placement, for cells that are not cubes or rotated against the world, for a velocity that is not finite, and for a
/// half width out of 3..1000; and Cancelled.
Solid solid(const Mesh& mesh, const Placement& placement, const openvdb::math::Transform& cells,
            const SolidOptions& options = {});
/// The same from a field.
Solid solid(const LevelSet& field, const Placement& placement, const openvdb::math::Transform& cells,
            const SolidOptions& options = {});

}  // namespace bilayer::fluid
