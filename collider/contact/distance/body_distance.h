// SPDX-License-Identifier: Apache-2.0
// Parts of the answers of distance().
// Tested by tests/collider/distance.cpp and tests/collider/shape_distance.cpp.
#pragma once

#include <algorithm>
#include <glm/gtc/quaternion.hpp>
#include <utility>

#include <bilayer/collider/distance.h>
#include "collider/contact/distance/mesh_distance.h"
#include "collider/contact/distance/triangle_distance.h"

namespace bilayer::detail {

/// Maps coordinates of a body to the world.
inline Similarity toWorld(const Pose& pose, float scale) {
    return {glm::mat3_cast(glm::normalize(glm::dquat(pose.rotation))), double(scale), glm::dvec3(pose.position)};
}

/// The separation up to which distance() searches [m]. It is larger than the limit by what distances may be off by, so
/// that bodies at the limit are found, and bodies that touch with a limit of zero.
/// @param size  of the larger body [m]
inline double searchLimit(const DistanceOptions& options, double size) {
    constexpr double tolerance = 2e-6;  // distanceBetween() is exact to 1e-6 of the diagonal
    return std::max(0.0, double(options.maxDistance)) + tolerance * size;
}

inline WitnessPoint witness(const Similarity& toWorld, const TrianglePoint& point, std::uint32_t triangle) {
    return {toWorld(point.position), triangle, point.feature, point.index};
}

/// The same answer with the bodies in the other order.
inline BodyDistance swapped(BodyDistance answer) {
    std::swap(answer.a, answer.b);
    answer.normal = -answer.normal;
    if (answer.overlap == Overlap::aInsideB)
        answer.overlap = Overlap::bInsideA;
    else if (answer.overlap == Overlap::bInsideA)
        answer.overlap = Overlap::aInsideB;
    return answer;
}

}  // namespace bilayer::detail
