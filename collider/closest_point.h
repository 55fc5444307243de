// What a query for the closest point of a surface answers.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <limits>

namespace bilayer {

/// The part of a triangle that a closest point lies on.
enum class Feature : std::uint8_t { face, edge, vertex };

inline constexpr std::uint32_t noTriangle = ~0u;

/// The point of a surface that is closest to another.
struct ClosestPoint {
    float distance = std::numeric_limits<float>::infinity();  ///< negative inside [m]
    glm::vec3 position{0};                                    ///< on the surface [m]
    /// Outward, of unit length: of the face, or of the edge or vertex the mean over all triangles around it, weighted by
    /// their angles there.
    glm::vec3 normal{0};
    std::uint32_t triangle = noTriangle;  ///< of the mesh; `noTriangle` for a field without its mesh
    Feature feature = Feature::face;
    std::uint8_t index = 0;  ///< which edge (from the triangle's corner `index` to the next) or corner
    bool found = false;      ///< there is one within the distance asked for; else nothing else counts
};

}  // namespace bilayer
