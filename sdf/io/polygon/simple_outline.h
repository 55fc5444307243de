// SPDX-License-Identifier: Apache-2.0
// Detects whether a polygon in the plane crosses itself; internal.
// Tested by tests/sdf/triangulate.cpp through triangulate().
#pragma once

#include <glm/vec2.hpp>
#include <span>

namespace bilayer::detail {

/// Returns whether a closed polygon encloses a region once: no two edges cross at interior points of both, and it winds
/// around each point once counter-clockwise, or not at all. It may touch itself at corners, along edges, and traverse
/// an edge in both directions. Exact where lineSide() is. Takes O(n log n), by the sweep of M. I. Shamos and D. Hoey,
/// "Geometric Intersection Problems" (1976), which stops at the first crossing.
bool enclosesOnce(std::span<const glm::dvec2> outline);

}  // namespace bilayer::detail
