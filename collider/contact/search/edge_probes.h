// SPDX-License-Identifier: Apache-2.0
// Probes: the points of an edge or a face at which another body's field is sampled.
// Tested by tests/bullet/edges.cpp through collideConvex().
#pragma once

#include <algorithm>
#include <cmath>

namespace bilayer::detail {

/// Spacing of the probes along an edge [voxels]; the same as that of the field's surface points.
inline constexpr float probeSpacing = 2;

/// The count of intervals that the probes divide an edge into, at least 1. The lengths share any one unit.
inline int probeIntervals(float length, float voxelSize, int maxCount) {
    return int(std::clamp(std::ceil(length / (probeSpacing * voxelSize)), 1.f, float(maxCount)));
}

}  // namespace bilayer::detail
