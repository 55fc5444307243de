// A moving body as an obstacle in a fluid solver's cells.
#pragma once

#include <openvdb/openvdb.h>

#include <bilayer/integration/fluid/placement.h>
#include <bilayer/sdf/level_set.h>
#include <bilayer/sdf/mesh.h>

namespace bilayer::fluid {

/// How a rigid body moves: a point x of it at linear + angular x (x - its pose's position).
struct Velocity {
    glm::vec3 linear{0};   ///< [m/s]
    glm::vec3 angular{0};  ///< [rad/s]
};

/// What pressure solvers ask of an obstacle. Cells are the voxels, centred at integer index coordinates; a staggered
/// grid's value at a cell is that of its three lower faces, half a voxel down each axis, as OpenVDB has it.
struct Solid {
    openvdb::FloatGrid::Ptr distance;   ///< `solid`: at the centres, a level set, negative inside the body [m]
    openvdb::Vec3SGrid::Ptr velocity;   ///< `solid_velocity`: of the body across each face in the band [m/s]; staggered
    openvdb::Vec3SGrid::Ptr openFaces;  ///< `open_faces`: the part of each face that is not solid, 0..1; staggered
    openvdb::FloatGrid::Ptr openVolume;  ///< `open_volume`: the part of each cell that is not solid, 0..1
};

struct SolidOptions {
    Velocity velocity{};
    float halfWidth = 3;  ///< of `distance` and `velocity` [voxels], at least 3
};

/// Faces and cells are open as the distances at the cells' corners say, linear between them: exact for a plane, else of
/// second order (C. Batty, F. Bertails, R. Bridson, "A fast variational framework for accurate solid-fluid coupling",
/// 2007, weigh faces so; C. Min, F. Gibou, "Geometric integration over arbitrary domains", 2007, cut cells into
/// tetrahedra). A plate thinner than a cell may lie between corners: there it closes no face. Active are the cells that
/// are not open altogether. Throws as regrid() does, for cells that are turned against the world, for a velocity that
/// is not finite, and for a half width out of 3..1000.
Solid solid(const Mesh& mesh, const Placement& placement, const openvdb::math::Transform& cells,
            const SolidOptions& options = {});
Solid solid(const LevelSet& field, const Placement& placement, const openvdb::math::Transform& cells,
            const SolidOptions& options = {});

}  // namespace bilayer::fluid
