// SPDX-License-Identifier: Apache-2.0
// The velocity of a liquid across the faces of its cells, advected by OpenVDB's tools.
#pragma once

#include <openvdb/openvdb.h>

#include <array>

namespace bilayer::demo {

/// A staggered velocity with one grid per axis, so that each face is known (active) or unknown independently. The value
/// of a voxel is the speed across the cell's lower face along that axis [m/s]. The transform of the grid places the
/// value at the face.
struct FaceVelocity {
    explicit FaceVelocity(const openvdb::math::Transform& transform);

    openvdb::math::Transform::ConstPtr cells;
    std::array<openvdb::FloatGrid::Ptr, 3> axes;

    /// Returns one staggered grid in the transform of the cells, as OpenVDB's tools expect it.
    openvdb::Vec3SGrid::Ptr together() const;
    /// Returns the velocity at the cell centres, interpolated between their faces.
    openvdb::Vec3SGrid::Ptr atCentres() const;
    /// Returns the max speed of all known faces [m/s].
    float fastest() const;
};

/// Extends the velocity outwards by this count of layers. Each new face gets the mean of its known neighbours.
void extrapolate(FaceVelocity& velocity, int layers);

/// Advects the velocity along itself by MacCormack's scheme with its limiter (openvdb::tools::VolumeAdvection). The
/// known faces stay the same.
FaceVelocity advected(const FaceVelocity& velocity, float seconds);

}  // namespace bilayer::demo
