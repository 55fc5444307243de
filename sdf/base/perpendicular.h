// SPDX-License-Identifier: Apache-2.0
// Directions perpendicular to others.
// Tested by tests/sdf/wide_tree.cpp.
#pragma once

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

namespace bilayer::detail {

/// A unit vector perpendicular to another unit vector.
template <class Scalar>
glm::vec<3, Scalar> perpendicularTo(const glm::vec<3, Scalar>& unit) {
    constexpr Scalar diagonal = Scalar(0.70710678);
    const Scalar none(0);
    return glm::normalize(std::abs(unit.z) > diagonal ? glm::vec<3, Scalar>(none, -unit.z, unit.y)
                                                      : glm::vec<3, Scalar>(-unit.y, unit.x, none));
}

}  // namespace bilayer::detail
