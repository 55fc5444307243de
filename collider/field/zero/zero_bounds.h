// SPDX-License-Identifier: Apache-2.0
// Lower bounds of the distances from a point to the zeros of a cube. Lengths in voxels.
// Tested by tests/collider/zero_set.cpp through Field::closest().
#pragma once

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include "collider/field/zero/zero_cube.h"

namespace bilayer::detail {

inline double boxDistance(const glm::dvec3& point, const glm::dvec3& lower, const glm::dvec3& upper) {
    return glm::distance(point, glm::clamp(point, lower, upper));
}

/// A direction that separates a point from the zeros of a cube: measured from the point along the unit vector
/// `direction`, all zeros are at least `smallest` away. The zeros lie in the cube, in the slab around the plane where
/// the linear part of the interpolant is zero. The error of the linear part gives the thickness of the slab.
struct Separation {
    glm::dvec3 direction;
    double smallest;
};
Separation separation(const glm::dvec3& point, const CubeExpansion& cube) noexcept;

/// A bound that allows for the curvature of the interpolant. If the surface is a sphere about the point, its error
/// falls with the third power of the cube's side; that of separation() falls with the second.
double curvedDistance(const glm::dvec3& point, const CubeExpansion& cube) noexcept;

}  // namespace bilayer::detail
