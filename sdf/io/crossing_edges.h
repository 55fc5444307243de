// SPDX-License-Identifier: Apache-2.0
// Detects whether a polygon in the plane crosses itself; internal.
// Tested by tests/sdf/triangulate.cpp.
#pragma once

#include <glm/vec2.hpp>
#include <span>

namespace bilayer::detail {

/// Returns whether two edges of a closed polygon cross at interior points of both. Edges that only touch or overlap do
/// not count. Exact where lineSide() is. Takes O(n log n), by the sweep of M. I. Shamos and D. Hoey, "Geometric
/// Intersection Problems" (1976), which stops at the first crossing.
bool hasCrossingEdges(std::span<const glm::dvec2> outline);

}  // namespace bilayer::detail
