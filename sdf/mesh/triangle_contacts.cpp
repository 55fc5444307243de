// SPDX-License-Identifier: Apache-2.0
#include "sdf/mesh/triangle_contacts.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <glm/common.hpp>

namespace bilayer::detail {
namespace {

/// In units of the slack: narrower contact areas count as one line, and neighbours may touch so far from a common
/// vertex.
constexpr double negligible = 4;

/// The planes through a face's edges, perpendicular to it.
class EdgePlanes {
  public:
    EdgePlanes(const DoubleTriangle& face, double slack) : slack_(2 * slack) {
        for (std::size_t i = 0; i < 3; ++i) {
            const glm::dvec3 &from = face.corners[i], along = face.corners[(i + 1) % 3] - from;
            outward_[i] = glm::normalize(glm::cross(along, face.normal));
            offset_[i] = glm::dot(outward_[i], from);
        }
    }

    /// The unit vector across edge i that leads away from the face.
    const glm::dvec3& outward(std::size_t i) const { return outward_[i]; }

    /// Whether a box is beyond one of the planes by more than the slack.
    bool isBeyond(const glm::dvec3& lower, const glm::dvec3& upper) const {
        for (std::size_t i = 0; i < 3; ++i)
            if (glm::dot(outward_[i], lower + upper) - glm::dot(glm::abs(outward_[i]), upper - lower) >
                2 * (offset_[i] + slack_))
                return true;
        return false;
    }

    bool isBeyond(const TriangleCorners& triangle) const {
        for (std::size_t i = 0; i < 3; ++i) {
            const auto height = [&](const glm::dvec3& p) { return glm::dot(outward_[i], p) - offset_[i]; };
            if (std::min({height(triangle[0]), height(triangle[1]), height(triangle[2])}) > slack_) return true;
        }
        return false;
    }

  private:
    std::array<glm::dvec3, 3> outward_;
    std::array<double, 3> offset_;
    double slack_;  // twice that of the contacts, for rounding
};

/// Tests whether a box overlaps a face's bounding box, its plane, and the prism over it, with the slack as a margin.
class TriangleOverlap {
  public:
    TriangleOverlap(const Bounds& own, const DoubleTriangle& face, const EdgePlanes& edges, double slack)
        : lower_(glm::dvec3(own.lower) - slack),
          upper_(glm::dvec3(own.upper) + slack),
          normal_(face.normal),
          away_(glm::abs(face.normal)),
          at_(2 * glm::dot(face.normal, face.corners[0])),
          slack_(2 * slack),
          edges_(edges) {}

    bool operator()(const Bounds& other) const {
        const glm::dvec3 lower(other.lower), upper(other.upper);
        for (int axis = 0; axis < 3; ++axis)
            if (lower[axis] > upper_[axis] || lower_[axis] > upper[axis]) return false;
        return std::abs(glm::dot(normal_, lower + upper) - at_) <= glm::dot(away_, upper - lower) + slack_ &&
               !edges_.isBeyond(lower, upper);
    }

  private:
    const glm::dvec3 lower_, upper_;
    const glm::dvec3 normal_, away_;
    const double at_, slack_;  // both doubled
    const EdgePlanes& edges_;
};

/// Whether a neighbour leads away from the edge or vertex that it shares with a face, so that nothing else of it comes
/// near the face. Seen along the normal, points of its other edges that are no farther than the slack beyond the face's
/// edges are at most slack / minSlope from a shared vertex. True for most neighbours.
/// @param a, b  vertices of the face and of the neighbour, whose corners are given
bool leadsAway(const glm::uvec3& a, const glm::uvec3& b, const TriangleCorners& corners, const EdgePlanes& edges) {
    constexpr double minSlope = 1.05 / negligible;
    int count = 0, sumInA = 0, sumInB = 0;
    for (int i = 0; i < 3; ++i)
        for (int k = 0; k < 3; ++k)
            if (a[i] == b[k]) ++count, sumInA += i, sumInB += k;
    const auto leads = [&](const glm::dvec3& outward, double slope, int from, int to) {
        const glm::dvec3 along = corners[std::size_t(to)] - corners[std::size_t(from)];
        return glm::dot(outward, along) >= slope * glm::length(along);
    };
    if (b.x == b.y || b.y == b.z || b.z == b.x) return false;
    if (count == 2) {
        const int third = 3 - sumInB;
        const glm::dvec3& outward = edges.outward(std::size_t(4 - sumInA) % 3);  // of the edge opposite 3 - sumInA
        return leads(outward, minSlope, (third + 1) % 3, third) && leads(outward, minSlope, (third + 2) % 3, third);
    }
    if (count != 1) return false;
    const glm::dvec3 &next = edges.outward(std::size_t(sumInA)), &last = edges.outward(std::size_t(sumInA + 2) % 3);
    const auto bothLead = [&](const glm::dvec3& outward, double slope) {
        return leads(outward, slope, sumInB, (sumInB + 1) % 3) && leads(outward, slope, sumInB, (sumInB + 2) % 3);
    };
    return bothLead(next, minSlope) || bothLead(last, minSlope) || bothLead(next + last, 2 * minSlope);
}

/// A point on a face's plane, and the height from which it was projected.
struct ProjectedPoint {
    glm::dvec3 at;
    double height;
};

using ProjectedPolygon = std::vector<ProjectedPoint>;

ProjectedPoint atHeight(const ProjectedPoint& a, const ProjectedPoint& b, double height) {
    return {a.at + (height - a.height) / (b.height - a.height) * (b.at - a.at), height};
}

/// Returns the part of a convex polygon on one side of a height: above it (1) or below it (-1).
ProjectedPolygon clipped(const ProjectedPolygon& polygon, double height, double side) {
    ProjectedPolygon part;
    for (std::size_t i = 0; i < polygon.size(); ++i) {
        const ProjectedPoint &a = polygon[i], &b = polygon[(i + 1) % polygon.size()];
        const double atA = side * (a.height - height), atB = side * (b.height - height);
        if (atA >= 0) part.push_back(a);
        if (atA * atB < 0) part.push_back(atHeight(a, b, height));
    }
    return part;
}

std::vector<glm::dvec3> pointsOf(const ProjectedPolygon& polygon) {
    std::vector<glm::dvec3> points;
    for (const ProjectedPoint& p : polygon) points.push_back(p.at);
    return points;
}

std::vector<Segment> outline(const std::vector<glm::dvec3>& points) {
    std::vector<Segment> edges;
    for (std::size_t i = 0; i < points.size(); ++i) edges.push_back({points[i], points[(i + 1) % points.size()]});
    return edges;
}

Segment farthest(const std::vector<glm::dvec3>& points) {
    Segment best{points[0], points[1]};
    for (std::size_t i = 0; i < points.size(); ++i)
        for (std::size_t k = 0; k < i; ++k)
            if (glm::length(points[i] - points[k]) > glm::length(best.to - best.from)) best = {points[i], points[k]};
    return best;
}

bool isNarrow(const std::vector<glm::dvec3>& points, const glm::dvec3& normal, double width) {
    const Segment longest = farthest(points);
    const glm::dvec3 along = longest.to - longest.from;
    if (!(glm::length(along) > width)) return true;
    const glm::dvec3 across = glm::normalize(glm::cross(normal, along));
    double low = 0, high = 0;
    for (const glm::dvec3& p : points) {
        const double to = glm::dot(across, p - longest.from);
        low = std::min(low, to);
        high = std::max(high, to);
    }
    return high - low <= width;
}

// Returns the outline of the part of a triangle within the slack of a plane. If the triangle is so steep that this part
// is narrow, the outline is one segment: where the triangle meets the plane, if it does.
std::vector<Segment> contacts(const ProjectedPolygon& triangle, const glm::dvec3& normal, double slack) {
    const ProjectedPolygon close = clipped(clipped(triangle, -slack, 1), slack, -1);
    if (close.size() < 2) return {};
    const std::vector<glm::dvec3> points = pointsOf(close);
    if (!isNarrow(points, normal, negligible * slack)) return outline(points);
    std::vector<glm::dvec3> line;
    for (std::size_t i = 0; i < 3; ++i) {
        const ProjectedPoint &a = triangle[i], &b = triangle[(i + 1) % 3];
        const bool aTouches = std::abs(a.height) <= slack, bTouches = std::abs(b.height) <= slack;
        if (aTouches) line.push_back(a.at);
        if (a.height * b.height < 0 && !(aTouches && bTouches)) line.push_back(atHeight(a, b, 0).at);
    }
    return {farthest(line.size() < 2 ? points : line)};
}

}  // namespace

std::vector<Segment> TriangleContacts::within(unsigned triangle) const {
    const DoubleTriangle face(mesh_, mesh_.triangles[triangle]);
    std::vector<Segment> found;
    if (!(face.area > 0)) return found;
    const EdgePlanes edges(face, slack_);
    tree_.descend(TriangleOverlap(tree_.boxOf(triangle), face, edges, slack_), [&](unsigned other) {
        if (other == triangle) return;
        const TriangleCorners corners = cornersOf(mesh_, other);
        if (leadsAway(topology_.triangles[triangle], topology_.triangles[other], corners, edges)) return;
        const double height[] = {face.height(corners[0]), face.height(corners[1]), face.height(corners[2])};
        const auto [low, high] = std::minmax({height[0], height[1], height[2]});
        if (low <= 2 * slack_ && high >= -2 * slack_ && !edges.isBeyond(corners))
            add(triangle, face, other, corners, found);
    });
    return found;
}

void TriangleContacts::add(unsigned triangle, const DoubleTriangle& face, unsigned other,
                           const TriangleCorners& corners, std::vector<Segment>& found) const {
    ProjectedPolygon projected;
    for (const glm::dvec3& p : corners) projected.push_back({face.onPlane(p), face.height(p)});
    for (const Segment& segment : contacts(projected, face.normal, slack_)) {
        if (!(glm::length(segment.to - segment.from) > slack_)) continue;
        if (alongSharedEdge(triangle, other, face, segment)) continue;
        Segment within = segment;
        if (!clip(within, face.polygon(), face.normal, slack_)) continue;
        if (!atSharedVertex(triangle, other, face, within)) found.push_back(segment);
    }
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

bool TriangleContacts::atSharedVertex(unsigned triangle, unsigned other, const DoubleTriangle& face,
                                      const Segment& segment) const {
    const glm::uvec3 &a = topology_.triangles[triangle], &b = topology_.triangles[other];
    for (int i = 0; i < 3; ++i) {
        if (a[i] != b.x && a[i] != b.y && a[i] != b.z) continue;
        const glm::dvec3& at = face.corners[std::size_t(i)];
        if (std::max(glm::length(segment.from - at), glm::length(segment.to - at)) <= negligible * slack_) return true;
    }
    return false;
}

}  // namespace bilayer::detail
