// SPDX-License-Identifier: Apache-2.0
// Distances of triangles and of surfaces by brute force, in double precision.
#pragma once

#include <bilayer/collider/contact.h>
#include "sdf/base/triangle_corners.h"

namespace bilayer::test {

/// The squared distance of two triangles; 0 if they intersect.
double triangleDistance2(const detail::TriangleCorners& a, const detail::TriangleCorners& b);

/// A point of the body in world coordinates.
glm::dvec3 inWorld(const Placed& body, const glm::dvec3& point);

/// The distance of two surfaces; 0 if they intersect.
double surfaceDistance(const Placed& a, const Placed& b);

}  // namespace bilayer::test
