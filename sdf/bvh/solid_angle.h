// SPDX-License-Identifier: Apache-2.0
// The solid angle of a triangle.
//
// A. Van Oosterom, J. Strackee, "The solid angle of a plane triangle", IEEE TBME 30 (1983).
// Tested by tests/sdf/winding.cpp through WindingNumber.
#pragma once

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

namespace bilayer::detail {

struct SolidAngle {
    double value;  ///< [sr]
    bool jumps;    ///< the apex lies on the triangle or an edge of it, up to rounding: the angle jumps there
};

// Most triangles are small and far: a series of the inverse tangent is then exact, and faster than std::atan2.
inline double angleOf(double y, double x) {
    if (!(std::abs(y) < 0.1 * x)) return std::atan2(y, x);
    const double t = y / x, s = t * t;
    return t * (1 - s * (1.0 / 3 - s * (1.0 / 5 - s * (1.0 / 7 - s * (1.0 / 9 - s * (1.0 / 11 - s / 13))))));
}

/// Returns the solid angle of a triangle, from its corners relative to the apex.
inline SolidAngle solidAngle(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c) {
    constexpr double flat = 1e-6;  // the sine of the directions of corners around an apex on the triangle
    const double la = glm::length(a), lb = glm::length(b), lc = glm::length(c), product = la * lb * lc;
    const double above = glm::dot(a, glm::cross(b, c));
    const double below = product + glm::dot(a, b) * lc + glm::dot(b, c) * la + glm::dot(c, a) * lb;
    return {2 * angleOf(above, below), below <= flat * product && std::abs(above) <= flat * product};
}

}  // namespace bilayer::detail
