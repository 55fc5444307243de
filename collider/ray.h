// What rays and overlaps ask, and what they are answered.
#pragma once

#include <cstdint>
#include <glm/gtc/quaternion.hpp>
#include <glm/vec3.hpp>
#include <limits>

#include "collider/closest_point.h"

namespace bilayer {

/// A ray, or the way of a sphere's centre.
struct Ray {
    glm::vec3 origin{0};                                         ///< [m]
    glm::vec3 direction{0};                                      ///< of any length but zero
    float maxDistance = std::numeric_limits<float>::infinity();  ///< [m]
};

/// Where a ray, or a sphere on its way, meets the surface.
struct RayHit {
    float distance = 0;                   ///< along the ray [m]
    glm::vec3 position{0};                ///< on the surface; the origin of a ray that starts inside [m]
    glm::vec3 normal{0};                  ///< outward, of unit length; against the ray where nothing else is known
    std::uint32_t triangle = noTriangle;  ///< of the mesh; `noTriangle` for a field without it or a start inside
};

/// A box that may be turned.
struct OrientedBox {
    glm::vec3 centre{0};             ///< [m]
    glm::vec3 halfSize{0};           ///< along its own axes, not negative [m]
    glm::quat rotation{1, 0, 0, 0};  ///< of unit length; w, x, y, z
};

}  // namespace bilayer
