// What a field is asked, and what it answers.
#pragma once

#include <cstdint>
#include <glm/gtc/quaternion.hpp>
#include <glm/vec3.hpp>
#include <limits>

namespace bilayer {

/// The answer to a query at a point.
struct Sample {
    /// In the band: the signed distance [m]. Elsewhere: a bound with the right sign, whose magnitude the true distance
    /// is not below (but for the field's own error), and no distance. A band narrower than sqrt(3) voxels can bound
    /// nothing just beside it: the magnitude is 0 there. +infinity for a point that is not finite.
    float distance = 0;
    /// In the band: the analytic gradient of the same trilinear interpolant (its length is near 1, not exactly 1).
    /// Elsewhere: zero.
    glm::vec3 gradient{0};
    /// All eight voxels around the point are active: sure up to sqrt(3) voxels less than the band's width on either
    /// side.
    bool inBand = false;
};

/// The part of a triangle that a closest point lies on.
enum class Feature : std::uint8_t { face, edge, vertex };

inline constexpr std::uint32_t noTriangle = ~0u;

/// The point of a surface that is closest to another.
struct ClosestPoint {
    float distance = std::numeric_limits<float>::infinity();  ///< negative inside [m]
    glm::vec3 position{0};                                    ///< on the surface [m]
    /// Outward, of unit length: of the face, or of the edge or vertex the mean over all triangles around it, weighted
    /// by their angles there.
    glm::vec3 normal{0};
    std::uint32_t triangle = noTriangle;  ///< of the mesh; `noTriangle` for a field without its mesh
    Feature feature = Feature::face;
    std::uint8_t index = 0;  ///< which edge (from the triangle's corner `index` to the next) or corner
    bool found = false;      ///< there is one within the distance asked for; else nothing else counts
};

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
