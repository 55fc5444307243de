// How a field is touched by a point; internal.
#pragma once

#include <bilayer/collider/field.h>

namespace bilayer::detail {

/// In the field's own coordinates.
struct SurfaceSample {
    float distance;    ///< of the point from the surface; of one that comes from afar from the plane that it will meet
    glm::vec3 normal;  ///< outward; zero where the field tells none
    float approach = 0;  ///< Contact::approach
};

/// Of a point in the band: by its sample, or by the triangles.
SurfaceSample surfaceSampleAt(const Field& field, const glm::vec3& point, const Sample& sample, bool byTriangles);

/// Which way a point is from what is closest to it: across a face, and away from an edge or a corner, or from what a
/// field without triangles does not tell apart.
glm::vec3 directionOf(const ClosestPoint& closest, const glm::vec3& point, float voxelSize);

/// Whether a point of a face that is beside another surface looks at an edge of that one aslant: closer to the point's
/// normal, below the place that it sees, the other surface turns towards it. The edge's own points meet the face there.
/// @param position, normal  of the point
/// @param distance, seen    of the other surface there, outward
/// @param normalAt          glm::vec3 (const glm::vec3&): of the other surface near a place
template <class NormalAt>
bool seesEdgeObliquely(const glm::vec3& position, const glm::vec3& normal, float distance, const glm::vec3& seen,
                       NormalAt&& normalAt) {
    // what is within half a degree of the normal is seen straight
    constexpr float straight = 0.99996f, straighter = 0.1f;
    const float cosine = -glm::dot(seen, normal);
    if (cosine > straight) return false;
    const glm::vec3 there = normalAt(position - distance * seen - cosine * distance * normal);
    return 1 + glm::dot(there, normal) < straighter * (1 - cosine);
}

/// Where the gradient of a sample points to; zero where it is too short to tell: on a medial axis.
glm::vec3 directionOf(const Sample& sample, float voxelSize);

}  // namespace bilayer::detail
