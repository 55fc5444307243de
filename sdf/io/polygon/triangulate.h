// SPDX-License-Identifier: Apache-2.0
// Polygon triangulation.
#pragma once

#include <glm/vec3.hpp>
#include <span>
#include <vector>

namespace bilayer::detail {

/// Triangulates a polygon into n - 2 triangles for n corners. The triangles use every corner and every edge of the
/// outline once. Thus polygons that share edges become triangles that share edges, whatever their shape.
///
/// The outline may be concave, have corners on straight edges, repeat corners, touch itself at corners and along edges,
/// and reach holes by edges that it traverses in both directions. It need not be planar: it is triangulated in
/// projection onto the coordinate plane nearest to its own plane. All decisions in that plane are exact. Triangles
/// without area occur only where the outline leaves no choice: at corners with the same position, and where it goes
/// along a line and back with nothing in between. Takes O(n log n) for all but contrived outlines. Thread-safe.
/// @param outline    corners in order; of either orientation. Finite.
/// @param triangles  appended: indices into `outline`, oriented like the outline. None for fewer than three corners.
/// @return whether the triangles cover exactly what the outline encloses, without overlap, in that coordinate plane:
///         false if the outline crosses itself or encloses nothing
bool triangulate(std::span<const glm::dvec3> outline, std::vector<glm::uvec3>& triangles);

}  // namespace bilayer::detail
