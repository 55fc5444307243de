// SPDX-License-Identifier: Apache-2.0
// The convex hull of points.
// Tested by tests/collider/shapes.cpp.
#pragma once

#include <glm/vec3.hpp>
#include <span>

#include "collider/contact/shapes/convex.h"

namespace bilayer::detail {

/// The convex hull of points, by Qhull. Throws std::invalid_argument if a point is not finite, or if the points lie in
/// one plane.
HullSurface convexHullOf(std::span<const glm::vec3> points);

}  // namespace bilayer::detail
