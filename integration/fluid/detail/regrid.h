// SPDX-License-Identifier: Apache-2.0
// Resamples bodies into a fluid's own voxels.
// Tested by tests/fluid/seed.cpp through seed().
#pragma once

#include <openvdb/openvdb.h>

#include <functional>

#include <bilayer/integration/fluid/seed.h>
#include <bilayer/sdf/level_set.h>
#include <bilayer/sdf/mesh.h>

namespace bilayer::fluid::detail {

/// Max index coordinate of a body's box: keeps OpenVDB's 32-bit coordinates, and sums of two of them, in range.
inline constexpr double maxIndex = 1 << 29;
/// Min half width of a fluid's band, as openvdb::tools::checkLevelSet() requires [voxels].
inline constexpr float minHalfWidthVoxels = 3;

/// The signed distances of a placed mesh, in voxels of another grid. They are exact, as build() computes them, for any
/// scaling and rotation of the body. Signs are found as by Sign::automatic.
/// @param voxels       cubes, not mirrored, of any size and position
/// @param width        of the band to either side [m]
/// @param progress     as BuildOptions::progress
/// @param uniteSolids  as BuildOptions::unite
///
/// Throws std::invalid_argument for
/// - a placement that checkPlacement() refuses, or one beyond the range of OpenVDB's coordinates;
/// - voxels that are not cubes or mirrored;
/// - a mesh with a hole wider than two voxels (hole_width.h), at any position of the voxels;
/// - a body that would lie between the voxels at some position of them (lattice_cover.h);
/// - a mesh without an inside, which would need Sign::flood, at any position of the voxels;
/// - everything that build() refuses, such as a band of more memory than the machine has;
/// and Cancelled.
openvdb::FloatGrid::Ptr regrid(const Mesh& mesh, const Placement& placement, const openvdb::math::Transform& voxels,
                               float width, const std::function<bool(float)>& progress = {}, bool uniteSolids = true);

/// The same for a field. A field that is already in these voxels is copied. For another one the zero set is extracted,
/// which rounds off creases by a fraction of the field's voxel, and its distances are exact again. Its band may thus be
/// as narrow as a voxel. Also throws std::invalid_argument if the band is narrower than that, or the field has no
/// surface.
openvdb::FloatGrid::Ptr regrid(const LevelSet& field, const Placement& placement,
                               const openvdb::math::Transform& voxels, float width,
                               const std::function<bool(float)>& progress = {});

/// Throws std::invalid_argument if no voxel of a band is inside: a closed body may lie between the voxels.
void requireInside(const openvdb::FloatGrid& band);

}  // namespace bilayer::fluid::detail
