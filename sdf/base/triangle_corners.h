// SPDX-License-Identifier: Apache-2.0
// The corners of a triangle in double precision.
// Tested by tests/sdf/exact.cpp through build().
#pragma once

#include <array>
#include <glm/vec3.hpp>

namespace bilayer::detail {

using TriangleCorners = std::array<glm::dvec3, 3>;

/// Min height of a triangle relative to its longest edge. The projection onto the plane of a flatter one is no better
/// than one onto its edges.
inline constexpr double minRelativeHeight = 1e-10;

}  // namespace bilayer::detail
