// SPDX-License-Identifier: Apache-2.0
// The result of a point query on a field's surface, for contacts.
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

/// The direction of a sample's gradient. Zero if it is too short to have one: on the medial axis.
glm::vec3 directionOf(const Sample& sample, float voxelSize);

}  // namespace bilayer::detail
