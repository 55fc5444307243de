// Which side of a line a point of the plane lies on, without rounding; internal.
#pragma once

#include <cmath>
#include <glm/vec2.hpp>

namespace bilayer::detail {

/// lineSide() where rounding could decide.
int exactLineSide(const glm::dvec2& a, const glm::dvec2& b, const glm::dvec2& p);

/// 1: `p` lies to the left of the line from `a` to `b`, so that the three run counter-clockwise; -1: to the right; 0:
/// on it. Exact for coordinates whose products neither overflow nor underflow (sizes of 1e-140 to 1e150, or zero).
inline int lineSide(const glm::dvec2& a, const glm::dvec2& b, const glm::dvec2& p) {
    // the bound that J. R. Shewchuk (1997) proves for this filter
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
