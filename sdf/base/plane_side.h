// SPDX-License-Identifier: Apache-2.0
// On which side of a plane through three points a fourth point lies, without rounding error; internal.
// Tested by tests/sdf/inspect.cpp through inspect().
#pragma once

#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

namespace bilayer::detail {

/// Computes planeSide() exactly, for inputs where rounding could change the result.
int exactPlaneSide(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c, const glm::dvec3& d);

/// Returns 1 if (b - a) x (c - a) points to the side of the plane on which `d` lies, -1 if it points to the other side,
/// and 0 if `d` lies in the plane. Exact for coordinates that are floats.
inline int planeSide(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c, const glm::dvec3& d) {
    // relative to the sum of the absolute values of the products: a generous bound (J. R. Shewchuk, "Adaptive Precision
    // Floating-Point Arithmetic", 1997, gives 7.8e-16 for exact differences)
    constexpr double rounding = 2e-15;
    const glm::dvec3 u = b - a, v = c - a, w = d - a;
    const double volume = glm::dot(glm::cross(u, v), w);
    const glm::dvec3 products(std::abs(u.y * v.z) + std::abs(u.z * v.y), std::abs(u.z * v.x) + std::abs(u.x * v.z),
                              std::abs(u.x * v.y) + std::abs(u.y * v.x));
    const double bound = glm::dot(products, glm::abs(w));
    if (bound == 0) return 0;  // every product is zero, as in a plane across an axis
    if (std::abs(volume) > rounding * bound) return volume > 0 ? 1 : -1;
    return exactPlaneSide(a, b, c, d);
}

}  // namespace bilayer::detail
