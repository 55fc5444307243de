// A straight way in double precision; internal.
#pragma once

#include <algorithm>
#include <glm/vec3.hpp>
#include <optional>
#include <utility>

namespace bilayer {

/// From an origin along a direction; lengths in one unit, whichever.
struct Path {
    glm::dvec3 origin, direction;  ///< the direction of unit length
    double length;                 ///< may be infinite

    glm::dvec3 at(double along) const { return origin + along * direction; }
};

/// The part of a path, from and to, that lies in a box.
inline std::optional<std::pair<double, double>> clip(const Path& path, const glm::dvec3& lower,
                                                     const glm::dvec3& upper) {
    double enter = 0, leave = path.length;
    for (int k = 0; k < 3; ++k) {
        const double origin = path.origin[k], direction = path.direction[k];
        if (direction == 0 && (origin < lower[k] || origin > upper[k])) return std::nullopt;
        if (direction == 0) continue;
        const double low = (lower[k] - origin) / direction, high = (upper[k] - origin) / direction;
        enter = std::max(enter, std::min(low, high));
        leave = std::min(leave, std::max(low, high));
    }
    if (!(enter <= leave)) return std::nullopt;
    return std::pair(enter, leave);
}

}  // namespace bilayer
