// How far a field's interpolated distances may be off; internal.
#pragma once

namespace bilayer::detail {

/// What the interpolant may be off the distance, to either side: the mean way to the eight voxels around a point is at
/// most half a cell's diagonal [voxels].
inline constexpr float maxInterpolationError = 0.87f;

/// How fast the interpolant may change: by a voxel along each axis at once.
inline constexpr float steepestInterpolant = 1.7321f;

/// What is no farther outside of the surface than this is in the band. Both in one unit.
inline float surelyInBand(float exteriorWidth, float voxelSize) {
    return exteriorWidth - steepestInterpolant * voxelSize;
}

}  // namespace bilayer::detail
