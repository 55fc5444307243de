// SPDX-License-Identifier: Apache-2.0
// The corners of a triangle in double precision.
// Tested by tests/sdf/exact.cpp.
#pragma once

#include <array>
#include <glm/vec3.hpp>

namespace bilayer::detail {

using TriangleCorners = std::array<glm::dvec3, 3>;

}  // namespace bilayer::detail
