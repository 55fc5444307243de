// SPDX-License-Identifier: Apache-2.0
// The closest points of two triangles.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>

#include <bilayer/collider/query.h>
#include "sdf/base/triangle_corners.h"

namespace bilayer::detail {

/// A point of a triangle, and the feature that it lies on.
struct TrianglePoint {
    glm::dvec3 position{0};
    Feature feature = Feature::face;
    std::uint8_t index = 0;  ///< of the edge (from corner `index` to the next) or corner
};

/// The closest points of two triangles.
struct TrianglePair {
    double distance2;  ///< squared; 0 if the triangles intersect
    TrianglePoint a, b;
};

/// The triangles may be degenerate: to segments or points. The error of the distance is some roundings of the largest
/// coordinate difference; over the inside of a sliver, times its length over its width.
TrianglePair closestPoints(const TriangleCorners& a, const TriangleCorners& b);

}  // namespace bilayer::detail
