// SPDX-License-Identifier: Apache-2.0
// The point of a triangle nearest to a point.
// Tested by tests/bullet/convex.cpp through Convex.
#pragma once

#include <algorithm>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

namespace bilayer::detail {

/// The point of a triangle nearest to a point.
inline glm::vec3 nearestOnTriangle(const glm::vec3& point, const glm::vec3& a, const glm::vec3& b, const glm::vec3& c) {
    const auto onSegment = [&](const glm::vec3& from, const glm::vec3& to) {
        const glm::vec3 along = to - from;
        const float squared = glm::dot(along, along);
        return squared > 0 ? from + std::clamp(glm::dot(point - from, along) / squared, 0.f, 1.f) * along : from;
    };
    const glm::vec3 normal = glm::cross(b - a, c - a);
    const float squaredArea = glm::dot(normal, normal);
    if (squaredArea > 0) {
        const glm::vec3 foot = point - (glm::dot(point - a, normal) / squaredArea) * normal;
        const auto leftOf = [&](const glm::vec3& from, const glm::vec3& to) {
            return glm::dot(glm::cross(to - from, foot - from), normal) >= 0;
        };
        if (leftOf(a, b) && leftOf(b, c) && leftOf(c, a)) return foot;
    }
    glm::vec3 best = onSegment(a, b);
    for (const glm::vec3& q : {onSegment(b, c), onSegment(c, a)})
        if (glm::distance(q, point) < glm::distance(best, point)) best = q;
    return best;
}

}  // namespace bilayer::detail
