// SPDX-License-Identifier: Apache-2.0
// The nearest point of a convex shape's surface.
// Tested by tests/bullet/convex.cpp.
#pragma once

#include <glm/vec3.hpp>

namespace bilayer::detail {

/// Normals within half a degree belong to one face (cosine).
inline constexpr float sameFaceCosine = 0.99996f;

struct NearestPoint {
    float distance;    ///< signed, to the surface [m]
    glm::vec3 normal;  ///< outward normal of the surface there, of unit length
    glm::vec3 core;    ///< nearest point of the shape's core: the surface there is that of a sphere around it
    float radius;      ///< of that sphere: growth of the core there [m]
};

}  // namespace bilayer::detail
