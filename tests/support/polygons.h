// SPDX-License-Identifier: Apache-2.0
// Measurements of polygons.
#pragma once

#include <algorithm>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <string>

#include "sdf/io/polygon/polygons.h"

namespace bilayer::test {

inline std::size_t faceCount(const detail::Polygons& p) {
    return p.sizes.empty() ? p.corners.size() / 3 : p.sizes.size();
}

/// The signed volume that flat convex faces enclose; positive if they face outward.
inline double volume(const detail::Polygons& p) {
    double six = 0;
    std::size_t first = 0;
    for (std::size_t face = 0; face < faceCount(p); ++face) {
        const std::size_t size = p.sizes.empty() ? 3 : p.sizes[face];
        const auto point = [&](std::size_t k) { return p.points[p.corners[first + k]]; };
        for (std::size_t k = 2; k < size; ++k) six += glm::dot(point(0), glm::cross(point(k - 1), point(k)));
        first += size;
    }
    return six / 6;
}

inline glm::dvec3 lower(const detail::Polygons& p) {
    glm::dvec3 low(1e300);
    for (const unsigned corner : p.corners) low = glm::min(low, p.points[corner]);
    return low;
}

inline glm::dvec3 upper(const detail::Polygons& p) {
    glm::dvec3 high(-1e300);
    for (const unsigned corner : p.corners) high = glm::max(high, p.points[corner]);
    return high;
}

inline bool mentions(const detail::Polygons& p, const std::string& text) {
    return std::any_of(p.notes.begin(), p.notes.end(),
                       [&](const std::string& note) { return note.find(text) != std::string::npos; });
}

}  // namespace bilayer::test
