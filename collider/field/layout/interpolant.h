// SPDX-License-Identifier: Apache-2.0
// Error bounds of a field's interpolated distances; internal.
// Tested by tests/collider/zero_set.cpp through Field::raycast().
#pragma once

namespace bilayer::detail {

/// The diagonal of a cell, and the Lipschitz constant of the trilinear interpolant [voxels]. A point is in the band if
/// the eight voxels around it are.
inline constexpr float cellDiagonal = 1.7320508f;

/// Max error of the interpolated distance to either side [voxels]. The mean distance to the eight voxels around a point
/// is at most half a cell's diagonal.
inline constexpr float maxInterpolationError = 0.87f;

/// Max slope of the interpolant: a voxel along each axis at once.
inline constexpr float maxInterpolantSlope = 1.7321f;

/// Points no farther outside the surface than this are in the band. Both lengths are in one unit.
inline float surelyInBand(float exteriorWidth, float voxelSize) {
    return exteriorWidth - maxInterpolantSlope * voxelSize;
}

}  // namespace bilayer::detail
