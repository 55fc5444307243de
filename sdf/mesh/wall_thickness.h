// SPDX-License-Identifier: Apache-2.0
// The thickness of the solid behind a surface.
// Tested by tests/sdf/triangle_tree.cpp.
#pragma once

#include <vector>

#include "sdf/bvh/triangle_tree.h"

namespace bilayer::detail {

/// For each triangle of the tree's mesh, returns the thickness of the solid behind it [m]. The thickness is the
/// distance from the triangle's centre, against its normal, to the point where the ray exits through the front of the
/// surface. It is infinite if the ray does not exit, or if it exits at a grazing angle (less than 12 degrees), as near
/// an edge.
std::vector<float> wallThickness(const TriangleTree& tree);

}  // namespace bilayer::detail
