// SPDX-License-Identifier: Apache-2.0
// The thickness of the solid behind a surface.
// Tested by tests/sdf/triangle_tree.cpp.
#pragma once

#include <cstddef>
#include <limits>
#include <vector>

#include "sdf/bvh/triangle_tree.h"

namespace bilayer::detail {

/// Which walls to measure.
struct WallSearch {
    float limit = std::numeric_limits<float>::infinity();  ///< rays end here [m]
    std::size_t stride = 1;                                ///< only each stride-th leaf of the tree is measured
};

/// For each triangle of the tree's mesh, returns the thickness of the solid behind it [m]. The thickness is the
/// distance from the triangle's centre, against its normal, to the point where the ray exits through the front of the
/// surface. It is infinite if the ray does not exit before the limit, if it exits at a grazing angle (less than 12
/// degrees), as near an edge, or if the triangle is not measured.
/// @param progress  polled for cancellation, unless null
std::vector<float> wallThickness(const TriangleTree& tree, const WallSearch& search = {}, Progress* progress = nullptr);

}  // namespace bilayer::detail
