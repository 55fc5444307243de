// Polygons to triangles.
#pragma once

#include <glm/vec3.hpp>
#include <span>
#include <vector>

namespace bilayer::detail {

/// Cuts a polygon into triangles, its corners less two of them. Together they use every corner and run along every edge
/// of the outline once, so that polygons that share edges become triangles that share edges, whatever their shape.
///
/// The outline may be concave, have corners on straight edges, repeat corners, touch itself, and reach holes by edges
/// that run both ways. It need not lie in a plane: it is cut as the coordinate plane sees it that is the nearest to its
/// own; all decisions there are exact. Triangles without area are made only where the outline leaves no choice: at
/// repeated corners, and where it runs out and back on a line with nothing in between.
/// O(n log n) for all but contrived outlines; safe from any thread.
/// @param outline    corners in order; of either sense of rotation. Finite.
/// @param triangles  appended: indices into `outline`, wound as the outline is. None for less than three corners.
/// @return whether the triangles cover what the outline encloses, without overlap and nothing else, in that coordinate
///         plane: false where the outline crosses itself or encloses nothing
bool triangulate(std::span<const glm::dvec3> outline, std::vector<glm::uvec3>& triangles);

}  // namespace bilayer::detail
