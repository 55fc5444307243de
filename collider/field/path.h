// Straight ways in double precision; internal.
#pragma once

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <optional>
#include <utility>

namespace bilayer::detail {

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

/// A point itself, or where it is more than `far` sizes of a box away from its middle, one on the way there, `near`
/// sizes away.
inline glm::dvec3 approached(const glm::dvec3& point, const glm::dvec3& lower, const glm::dvec3& upper, double far,
                             double near) {
    const glm::dvec3 centre = 0.5 * (lower + upper), way = point - centre, diagonal = upper - lower;
    const double size2 = glm::dot(diagonal, diagonal), away2 = glm::dot(way, way);
    return away2 > far * far * size2 ? centre + near * std::sqrt(size2 / away2) * way : point;
}

/// A path of its own, which begins some way along another one.
struct PathPart {
    Path path;
    double from;  ///< where it begins on the other one
};

/// The part of a path that lies in a box. It begins in the box and ends within reach of rounding there, however far
/// away the whole path begins: what is measured along it is as exact as the box is small.
inline std::optional<PathPart> partIn(const Path& path, const glm::dvec3& lower, const glm::dvec3& upper) {
    const auto whole = clip(path, lower, upper);
    if (!whole) return std::nullopt;
    const double from = whole->first;
    Path part{glm::clamp(path.at(from), lower, upper), path.direction, path.length - from};
    // on the face that it comes through, whatever rounding leaves of the way there
    for (int k = 0; from > 0 && k < 3; ++k) {
        const double face = path.direction[k] > 0 ? lower[k] : upper[k];
        if ((face - path.origin[k]) / path.direction[k] == from) part.origin[k] = face;
    }
    const auto within = clip(part, lower, upper);
    part.length = within ? within->second : 0;
    return PathPart{part, from};
}

}  // namespace bilayer::detail
