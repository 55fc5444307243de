// The velocity of a liquid across the faces of its cells, carried by OpenVDB's own tools.
#pragma once

#include <openvdb/openvdb.h>

#include <array>

namespace bilayer::demo {

/// A staggered velocity as a grid for each axis, so that each face is known (active) or not by itself. A voxel's value
/// is the speed across the cell's lower face along that axis [m/s], and the grid's transform places it there.
struct FaceVelocity {
    explicit FaceVelocity(const openvdb::math::Transform& transform);

    openvdb::math::Transform::ConstPtr cells;
    std::array<openvdb::FloatGrid::Ptr, 3> axes;

    /// The same as OpenVDB's tools take it: one staggered grid in the cells' own transform.
    openvdb::Vec3SGrid::Ptr together() const;
    /// At the cells' centres, between their faces.
    openvdb::Vec3SGrid::Ptr atCentres() const;
    /// Of all known faces [m/s].
    float fastest() const;
};

/// Gives the faces around the known ones the mean of their known neighbours, so many layers outwards.
void extrapolate(FaceVelocity& velocity, int layers);

/// Carries the velocity along itself, by MacCormack's scheme with its limiter (openvdb::tools::VolumeAdvection). Known
/// are the same faces as before.
FaceVelocity advected(const FaceVelocity& velocity, float seconds);

}  // namespace bilayer::demo
