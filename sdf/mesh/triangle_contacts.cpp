// SPDX-License-Identifier: Apache-2.0
#include "sdf/mesh/triangle_contacts.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <glm/common.hpp>

namespace bilayer::detail {
namespace {

/// In units of the slack: max length of a contact that neighbours with a common vertex or edge have next to it.
constexpr double shortContact = 4;

/// Tests whether a box overlaps both a face's bounding box and its plane, with the slack as a margin.
class TriangleOverlap {
  public:
    TriangleOverlap(const Bounds& own, const DoubleTriangle& face, double slack)
        : box_{own.lower - float(slack), own.upper + float(slack)},
          normal_(face.normal),
          away_(glm::abs(face.normal)),
          at_(2 * glm::dot(face.normal, face.corners[0])),
          slack_(2 * slack) {}

    bool operator()(const Bounds& other) const {
        for (int axis = 0; axis < 3; ++axis)
            if (other.lower[axis] > box_.upper[axis] || box_.lower[axis] > other.upper[axis]) return false;
        const glm::dvec3 lower(other.lower), upper(other.upper);
        return std::abs(glm::dot(normal_, lower + upper) - at_) <= glm::dot(away_, upper - lower) + slack_;
    }

  private:
    const Bounds box_;
    const glm::dvec3 normal_, away_;
    const double at_, slack_;  // both doubled
};

Segment farthest(const std::vector<glm::dvec3>& points) {
    Segment best{points[0], points[1]};
    for (std::size_t i = 0; i < points.size(); ++i)
        for (std::size_t k = 0; k < i; ++k)
            if (glm::length(points[i] - points[k]) > glm::length(best.to - best.from)) best = {points[i], points[k]};
    return best;
}

}  // namespace

std::vector<Segment> TriangleContacts::within(unsigned triangle) const {
    const DoubleTriangle face(mesh_, mesh_.triangles[triangle]);
    std::vector<Segment> found;
    if (!(face.area > 0)) return found;
    tree_.descend(TriangleOverlap(tree_.boxOf(triangle), face, slack_), [&](unsigned other) {
        if (other != triangle) add(triangle, face, other, found);
    });
    return found;
}

void TriangleContacts::add(unsigned triangle, const DoubleTriangle& face, unsigned other,
                           std::vector<Segment>& found) const {
    const glm::uvec3& t = mesh_.triangles[other];
    const TriangleCorners corners{glm::dvec3(mesh_.points[t.x]), glm::dvec3(mesh_.points[t.y]),
                                  glm::dvec3(mesh_.points[t.z])};
    const CornerHeights heights{face.height(corners[0]), face.height(corners[1]), face.height(corners[2])};
    const auto [lowest, highest] = std::minmax({heights[0], heights[1], heights[2]});
    if (lowest > slack_ || highest < -slack_) return;
    for (Segment segment : traces(face, corners, heights)) {
        if (alongSharedEdge(triangle, other, face, segment)) continue;
        if (!clip(segment, face.polygon(), face.normal, slack_)) continue;
        if (glm::length(segment.to - segment.from) > shortContact * slack_) found.push_back(segment);
    }
}

// Returns the intersection of a triangle with a face's plane: nothing, a segment, or all three edges.
std::vector<Segment> TriangleContacts::traces(const DoubleTriangle& face, const TriangleCorners& corners,
                                              const CornerHeights& heights) const {
    std::vector<Segment> edges;
    std::vector<glm::dvec3> points;
    for (std::size_t i = 0; i < 3; ++i) {
        const std::size_t k = (i + 1) % 3;
        const bool here = std::abs(heights[i]) <= slack_, there = std::abs(heights[k]) <= slack_;
        if (here) points.push_back(face.onPlane(corners[i]));
        if (here && there) edges.push_back({face.onPlane(corners[i]), face.onPlane(corners[k])});
        if (heights[i] * heights[k] < 0 && !(here && there))
            points.push_back(corners[i] + heights[i] / (heights[i] - heights[k]) * (corners[k] - corners[i]));
    }
    if (edges.size() == 3 || points.size() < 2) return edges;
    return {farthest(points)};
}

bool TriangleContacts::alongSharedEdge(unsigned triangle, unsigned other, const DoubleTriangle& face,
                                       const Segment& segment) const {
    const glm::uvec3 &a = topology_.triangles[triangle], &b = topology_.triangles[other];
    const auto shares = [&b](unsigned vertex) { return vertex == b.x || vertex == b.y || vertex == b.z; };
    for (int i = 0; i < 3; ++i) {
        if (!shares(a[i]) || !shares(a[(i + 1) % 3])) continue;
        const glm::dvec3 &from = face.corners[std::size_t(i)], &to = face.corners[std::size_t((i + 1) % 3)];
        const glm::dvec3 across = glm::normalize(glm::cross(face.normal, to - from));
        if (std::max(std::abs(glm::dot(across, segment.from - from)), std::abs(glm::dot(across, segment.to - from))) <=
            slack_)
            return true;
    }
    return false;
}

}  // namespace bilayer::detail
