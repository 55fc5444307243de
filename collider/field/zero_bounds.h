// SPDX-License-Identifier: Apache-2.0
// Lower bounds of the distances from a point to the zeros of a cube. Lengths in voxels.
// Tested by tests/collider/zero_set.cpp through Field::closest().
#pragma once

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include "collider/field/zero_cube.h"

namespace bilayer::detail {

inline double boxDistance(const glm::dvec3& point, const glm::dvec3& lower, const glm::dvec3& upper) {
    return glm::distance(point, glm::clamp(point, lower, upper));
}

/// A separating direction. The zeros of a cube are in its box, and no farther from the plane of its linear part than
/// the error. From a point outside that slab of the box, all of them have at least the distance `smallest` along a unit
/// direction.
struct Separation {
    glm::dvec3 direction;
    double smallest;
};
Separation separation(const glm::dvec3& point, const CubeExpansion& cube) noexcept;

/// A bound that takes into account the curvature of spheres about the point and of the interpolant. Where the surface
/// is such a sphere, its error falls with the cube of the side; that of `separation` falls with the square.
double curvedDistance(const glm::dvec3& point, const CubeExpansion& cube) noexcept;

}  // namespace bilayer::detail
