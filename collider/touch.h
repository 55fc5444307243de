// How a field is touched by a point; internal.
#pragma once

#include "collider/field.h"

namespace bilayer {

/// In the field's own coordinates.
struct Touch {
    float distance;    ///< of the point from the surface; of one that comes from afar from the plane that it will meet
    glm::vec3 normal;  ///< outward; zero where the field tells none
    float approach = 0;  ///< Contact::approach
};

/// Of a point in the band: by its sample, or by the triangles.
Touch touchInBand(const Field& field, const glm::vec3& point, const Sample& sample, bool byTriangles);

/// Which way a point is from what is closest to it: across a face, and away from an edge or a corner, or from what a
/// field without triangles does not tell apart.
glm::vec3 directionOf(const ClosestPoint& closest, const glm::vec3& point, float voxelSize);

/// Where the gradient of a sample points to; zero where it is too short to tell: on a medial axis.
glm::vec3 directionOf(const Sample& sample, float voxelSize);

}  // namespace bilayer
