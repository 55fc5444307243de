// SPDX-License-Identifier: Apache-2.0
// Straight paths in double precision; internal.
// Tested by tests/collider/field_rays.cpp through Field::raycast().
#pragma once

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <optional>
#include <utility>

namespace bilayer::detail {

/// An origin, a direction and a length, all in one unit.
struct Path {
    glm::dvec3 origin, direction;  ///< direction: unit length
    double length;                 ///< may be infinite

    glm::dvec3 at(double along) const { return origin + along * direction; }
};

/// Max count of tangent steps along a path towards a convex shape. If a path only grazes the shape, each step takes
/// half of the remaining distance.
inline constexpr int maxTangents = 64;

/// The interval of a path inside a box.
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

/// Returns the point itself if it is at most `far` box sizes away from the box centre. Otherwise returns the point
/// in the same direction from the centre, `near` box sizes away.
inline glm::dvec3 approached(const glm::dvec3& point, const glm::dvec3& lower, const glm::dvec3& upper, double far,
                             double near) {
    const glm::dvec3 centre = 0.5 * (lower + upper), offset = point - centre, diagonal = upper - lower;
    const double size2 = glm::dot(diagonal, diagonal), away2 = glm::dot(offset, offset);
    return away2 > far * far * size2 ? centre + near * std::sqrt(size2 / away2) * offset : point;
}

/// A section of a path, as a path of its own.
struct PathSection {
    Path path;
    double from;  ///< its start on the whole path
};

/// The section of a path inside a box. It starts in the box and ends there up to rounding, however far away the whole
/// path starts. Lengths along it are therefore as accurate as the box is small.
inline std::optional<PathSection> sectionIn(const Path& path, const glm::dvec3& lower, const glm::dvec3& upper) {
    const auto whole = clip(path, lower, upper);
    if (!whole) return std::nullopt;
    const double from = whole->first;
    Path section{glm::clamp(path.at(from), lower, upper), path.direction, path.length - from};
    // places the start exactly on the entry face, despite rounding
    for (int k = 0; from > 0 && k < 3; ++k) {
        const double face = path.direction[k] > 0 ? lower[k] : upper[k];
        if ((face - path.origin[k]) / path.direction[k] == from) section.origin[k] = face;
    }
    const auto within = clip(section, lower, upper);
    section.length = within ? within->second : 0;
    return PathSection{section, from};
}

}  // namespace bilayer::detail
