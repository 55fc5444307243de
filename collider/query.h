// SPDX-License-Identifier: Apache-2.0
// Arguments and results of field queries.
// Tested by tests/collider/field.cpp.
#pragma once

#include <cstdint>
#include <glm/gtc/quaternion.hpp>
#include <glm/vec3.hpp>
#include <limits>

namespace bilayer {

/// The result of sampling a field at a point.
struct Sample {
    /// In the band: the signed distance [m]. Elsewhere: only a bound, with the correct sign. The true distance is at
    /// least its magnitude, up to the field's own error. The magnitude is 0 just outside a band narrower than sqrt(3)
    /// voxels. +infinity for a non-finite point.
    float distance = 0;
    /// In the band: the analytic gradient of the trilinear interpolant; its length is about 1. Elsewhere: zero.
    glm::vec3 gradient{0};
    /// All eight voxels around the point are active. Guaranteed up to sqrt(3) voxels less than the band width on either
    /// side.
    bool inBand = false;
};

/// The kind of triangle feature that a closest point lies on.
enum class Feature : std::uint8_t {
    face,    ///< the interior of a triangle
    edge,    ///< the interior of an edge
    vertex,  ///< a corner of a triangle
};

/// In place of a triangle's index where there is none.
inline constexpr std::uint32_t noTriangle = ~0u;

/// The point of a surface that is closest to a query point.
struct ClosestPoint {
    float distance = std::numeric_limits<float>::infinity();  ///< negative inside [m]
    glm::vec3 position{0};                                    ///< on the surface [m]
    /// Outward unit normal: of the face, or for an edge or vertex the angle-weighted mean of the adjacent triangles.
    glm::vec3 normal{0};
    std::uint32_t triangle = noTriangle;  ///< index in the mesh; `noTriangle` for a field without its mesh
    Feature feature = Feature::face;      ///< of that triangle: its face, an edge or a corner
    std::uint8_t index = 0;               ///< of the edge (from corner `index` of the triangle to the next) or corner
    bool found = false;                   ///< false: no point within the search radius; the other members are invalid
};

/// A ray, or the path of a sphere's centre.
struct Ray {
    glm::vec3 origin{0};                                         ///< [m]
    glm::vec3 direction{0};                                      ///< any non-zero length
    float maxDistance = std::numeric_limits<float>::infinity();  ///< [m]
};

/// Where a ray or swept sphere hits the surface.
struct RayHit {
    float distance = 0;     ///< along the ray [m]
    glm::vec3 position{0};  ///< on the surface; the origin if the ray starts inside [m]
    /// Outward unit normal; the reversed ray direction where none is known. That of a face hit from behind faces the
    /// origin: that of an open surface, or a face beyond an edge that the ray grazes to within the tolerance.
    glm::vec3 normal{0};
    std::uint32_t triangle = noTriangle;  ///< index in the mesh; `noTriangle` without a mesh or for a start inside
};

/// An oriented box.
struct OrientedBox {
    glm::vec3 centre{0};             ///< [m]
    glm::vec3 halfSize{0};           ///< along its own axes, non-negative [m]
    glm::quat rotation{1, 0, 0, 0};  ///< unit quaternion; w, x, y, z
};

}  // namespace bilayer
