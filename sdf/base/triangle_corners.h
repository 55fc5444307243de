// SPDX-License-Identifier: Apache-2.0
// The corners of a triangle in double precision.
// Tested by tests/sdf/exact.cpp through build().
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include <bilayer/sdf/mesh.h>

namespace bilayer::detail {

using TriangleCorners = std::array<glm::dvec3, 3>;

inline TriangleCorners cornersOf(const Mesh& mesh, const glm::uvec3& t) {
    return {glm::dvec3(mesh.points[t.x]), glm::dvec3(mesh.points[t.y]), glm::dvec3(mesh.points[t.z])};
}
inline TriangleCorners cornersOf(const Mesh& mesh, std::uint32_t triangle) {
    return cornersOf(mesh, mesh.triangles[triangle]);
}

/// The squared length of the longest edge.
inline double longestEdge2(const TriangleCorners& c) {
    const glm::dvec3 ab = c[1] - c[0], bc = c[2] - c[1], ca = c[0] - c[2];
    return std::max({glm::dot(ab, ab), glm::dot(bc, bc), glm::dot(ca, ca)});
}

/// Min height of a triangle relative to its longest edge. The projection onto the plane of a flatter one is no better
/// than one onto its edges.
inline constexpr double minRelativeHeight = 1e-10;

}  // namespace bilayer::detail
