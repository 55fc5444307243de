// Whether an outline in the plane crosses itself; internal.
#pragma once

#include <glm/vec2.hpp>
#include <span>

namespace bilayer::detail {

/// Whether two edges of a closed outline cross within both. Edges that only touch, or that lie on one another, do not.
/// Exact where lineSide() is. O(n log n): the sweep of M. I. Shamos and D. Hoey, "Geometric Intersection Problems"
/// (1976), which stops at the first crossing.
bool hasCrossingEdges(std::span<const glm::dvec2> outline);

}  // namespace bilayer::detail
