// The result of a point query on a field's surface, for contacts; internal.
#pragma once

#include <bilayer/collider/field.h>

namespace bilayer::detail {

/// Distance and normal of the surface at a point, in field coordinates.
struct SurfaceSample {
    float distance;      ///< of the point from the surface; for a speculative contact, from the tangent plane at the
                         ///< predicted hit
    glm::vec3 normal;    ///< outward; zero where it is undefined
    float approach = 0;  ///< Contact::approach
};

/// Distance and normal at a point in the band, from its sample or from the triangles.
SurfaceSample surfaceSampleAt(const Field& field, const glm::vec3& point, const Sample& sample, bool byTriangles);

/// The contact normal for a closest point. The face normal on a face. The direction from the closest point at an edge
/// or vertex, and for a field without triangles, which does not distinguish features.
glm::vec3 directionOf(const ClosestPoint& closest, const glm::vec3& point, float voxelSize);

/// Whether a face point next to another surface sees an edge of that surface obliquely. The surface normal is evaluated
/// again next to the seen place, in the point's tangent plane. If it opposes the point's normal there, the place is on
/// an edge. The edge's own points then make the contact with the face.
/// @param position, normal  of the point
/// @param distance, seen    distance and outward normal of the other surface there
/// @param normalAt          glm::vec3 (const glm::vec3&): normal of the other surface near a place
template <class NormalAt>
bool seesEdgeObliquely(const glm::vec3& position, const glm::vec3& normal, float distance, const glm::vec3& seen,
                       NormalAt&& normalAt) {
    // within half a degree of the normal
    constexpr float straight = 0.99996f, straighter = 0.1f;
    const float cosine = -glm::dot(seen, normal);
    if (cosine > straight) return false;
    const glm::vec3 there = normalAt(position - distance * seen - cosine * distance * normal);
    return 1 + glm::dot(there, normal) < straighter * (1 - cosine);
}

/// The direction of a sample's gradient. Zero if it is too short to have one: on the medial axis.
glm::vec3 directionOf(const Sample& sample, float voxelSize);

}  // namespace bilayer::detail
