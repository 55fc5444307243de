// SPDX-License-Identifier: Apache-2.0
// The box that a triangle must overlap to be relevant.
// Tested by tests/sdf/exact.cpp.
#pragma once

#include <glm/common.hpp>
#include <glm/vec3.hpp>
#include <glm/vector_relational.hpp>

#include "sdf/base/triangle_corners.h"

namespace bilayer::detail {

/// A box in index coordinates [voxels].
struct TriangleLimits {
    glm::dvec3 lower, upper;
};

/// Returns whether the bounding box of a triangle misses the limits.
inline bool misses(const TriangleCorners& c, const TriangleLimits& limits) {
    const glm::dvec3 lower = glm::min(c[0], glm::min(c[1], c[2])), upper = glm::max(c[0], glm::max(c[1], c[2]));
    return glm::any(glm::greaterThan(lower, limits.upper)) || glm::any(glm::lessThan(upper, limits.lower));
}

}  // namespace bilayer::detail
