// SPDX-License-Identifier: Apache-2.0
// The filter of contacts by their normals, and the test for points that only graze a surface. They suppress ghost
// collisions with edges between faces.
#pragma once

#include <bilayer/collider/contact.h>

#include <algorithm>
#include <glm/geometric.hpp>

#include "collider/contact/shapes/nearest_point.h"

namespace bilayer::detail {

/// Rounding makes points that slide along a face hit the edges behind that face. Hits shallower than this are ignored
/// [voxels].
inline constexpr float grazingToleranceVoxels = 0.25f;

/// A face point that is less deep in the other body counts as separated. Such a point may touch an edge of that body,
/// and the normal there is that of either face, or one between them: rounding decides [voxels].
inline constexpr float minFaceDepthVoxels = 1e-3f;

/// The start of a second path, parallel to that of a surface point, but slightly inside the point's own body. A point
/// that only grazes another surface hits nothing along this path.
/// @param normal  of the point, of unit length
inline glm::vec3 grazingTestStart(const glm::vec3& point, const glm::vec3& normal, const glm::vec3& displacement,
                                  float voxelSize) {
    const glm::vec3 across =
        normal - glm::dot(normal, displacement) / glm::dot(displacement, displacement) * displacement;
    return point - grazingToleranceVoxels * voxelSize * across;
}

/// Whether a test holds for a normal that rotates: at the start, the middle or the end of the step.
/// @param rotation  in the step [rad]
/// @param test      bool (const glm::vec3& normal)
template <class Test>
bool holdsDuringRotation(const glm::vec3& normal, const glm::vec3& rotation, Test&& test) {
    const auto holdsAt = [&](float part) { return test(glm::normalize(normal + part * glm::cross(rotation, normal))); };
    return holdsAt(0) || (rotation != glm::vec3(0) && (holdsAt(0.5f) || holdsAt(1)));
}

/// Whether a contact passes, by the cosine between the reversed surface normal and the point's normal.
/// @param isSeparated  the point belongs to a face, and is not deeper than minFaceDepthVoxels
inline bool passesNormalFilter(const ContactOptions& options, float cosine, bool isSeparated) {
    return cosine >=
           (isSeparated ? std::max(options.minNormalCosineApart, options.minNormalCosine) : options.minNormalCosine);
}

/// The same for a point that rotates with its body: whether the point opposes the surface at some time of the step.
/// @param surfaceNormal, normal  outward normals of the surface and of the point
/// @param rotation               in the step relative to the surface [rad]
inline bool passesNormalFilter(const ContactOptions& options, const glm::vec3& surfaceNormal, const glm::vec3& normal,
                               const glm::vec3& rotation, bool isSeparated) {
    return holdsDuringRotation(normal, rotation, [&](const glm::vec3& rotated) {
        return passesNormalFilter(options, -glm::dot(surfaceNormal, rotated), isSeparated);
    });
}

/// The same, and a separated point must not face an edge obliquely.
/// @param facesEdge  bool (): facesEdgeObliquely() for this contact
template <class FacesEdge>
bool passesNormalFilter(const ContactOptions& options, const glm::vec3& surfaceNormal, const glm::vec3& normal,
                        const glm::vec3& rotation, bool isSeparated, FacesEdge&& facesEdge) {
    if (!passesNormalFilter(options, surfaceNormal, normal, rotation, isSeparated)) return false;
    return options.keepsObliqueEdges || !isSeparated || !facesEdge();
}

/// Whether the place of another surface that is closest to a face point lies on an edge, which the point faces
/// obliquely. The normal of that surface is evaluated once more, a little farther along the point's tangent plane. If
/// it opposes the point's normal there, a face lies beyond an edge. The points on that edge then make the contact.
/// @param position, normal         of the point
/// @param distance, surfaceNormal  distance and outward normal of the other surface there
/// @param holdsAt                  bool (const glm::vec3& place, test): whether a test holds for the normal of the
///                                 other surface near a place
template <class HoldsAt>
bool facesEdgeObliquely(const glm::vec3& position, const glm::vec3& normal, float distance,
                        const glm::vec3& surfaceNormal, HoldsAt&& holdsAt) {
    constexpr float maxRemainingPart = 0.1f;  // of 1 - cosine: on an edge, the normals there are almost opposite
    const float cosine = -glm::dot(surfaceNormal, normal);
    if (cosine > sameFaceCosine) return false;
    return holdsAt(position - distance * surfaceNormal - cosine * distance * normal, [&](const glm::vec3& there) {
        return 1 + glm::dot(there, normal) < maxRemainingPart * (1 - cosine);
    });
}

}  // namespace bilayer::detail
