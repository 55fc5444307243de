// SPDX-License-Identifier: Apache-2.0
// On which side of a line a point of the plane lies, without rounding error; internal.
// Tested by tests/sdf/triangulate.cpp.
#pragma once

#include <cmath>
#include <glm/vec2.hpp>

namespace bilayer::detail {

/// Computes lineSide() exactly, for inputs where rounding could change the result.
int exactLineSide(const glm::dvec2& a, const glm::dvec2& b, const glm::dvec2& p);

/// Returns 1 if `p` lies to the left of the line from `a` to `b` (the three points run counter-clockwise), -1 if it
/// lies to the right, and 0 if it lies on the line. Exact for coordinates whose products neither overflow nor underflow
/// (magnitudes of 1e-140 to 1e150, or zero).
inline int lineSide(const glm::dvec2& a, const glm::dvec2& b, const glm::dvec2& p) {
    // the error bound of this filter, proved by J. R. Shewchuk (1997)
    constexpr double rounding = 3.3306690738754716e-16;
    const double left = (a.x - p.x) * (b.y - p.y), right = (a.y - p.y) * (b.x - p.x);
    const double area = left - right;
    const double error = rounding * (std::abs(left) + std::abs(right));
    if (area > error) return 1;
    if (area < -error) return -1;
    if (error == 0) return 0;
    return exactLineSide(a, b, p);
}

}  // namespace bilayer::detail
