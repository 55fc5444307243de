// SPDX-License-Identifier: Apache-2.0
// Segments as in C. Ericson, "Real-Time Collision Detection", 2005, section 5.1.9. Two triangles are closest at two of
// their edges, at a corner and a face, or where they intersect.
#include "collider/contact/distance/triangle_distance.h"

#include <algorithm>
#include <glm/geometric.hpp>
#include <limits>
#include <optional>

namespace bilayer::detail {

namespace {

struct SegmentPair {
    double s, t;  // parameters along the two segments, in [0, 1]
    double distance2;
};

double dividedIn01(double numerator, double denominator) {
    return denominator > 0 ? std::clamp(numerator / denominator, 0.0, 1.0) : 0.0;
}

// The closest points of the segments p + s u and q + t v.
SegmentPair closestOnSegments(const glm::dvec3& p, const glm::dvec3& u, const glm::dvec3& q, const glm::dvec3& v) {
    const glm::dvec3 r = p - q;
    const double uu = glm::dot(u, u), vv = glm::dot(v, v), uv = glm::dot(u, v);
    const double ur = glm::dot(u, r), vr = glm::dot(v, r);
    const double determinant = uu * vv - uv * uv;
    // of parallel segments any s will do: t, and s again, are then the best
    double s = dividedIn01(uv * vr - ur * vv, determinant);
    const double t = dividedIn01(uv * s + vr, vv);
    s = dividedIn01(uv * t - ur, uu);
    const glm::dvec3 between = r + s * u - t * v;
    return {s, t, glm::dot(between, between)};
}

TrianglePoint onEdge(const TriangleCorners& c, std::size_t edge, double s) {
    const std::size_t next = (edge + 1) % 3;
    if (s <= 0) return {c[edge], Feature::vertex, std::uint8_t(edge)};
    if (s >= 1) return {c[next], Feature::vertex, std::uint8_t(next)};
    return {c[edge] + s * (c[next] - c[edge]), Feature::edge, std::uint8_t(edge)};
}

// A triangle with what tests of points against its interior need.
struct Plane {
    explicit Plane(const TriangleCorners& c)
        : corners(c), normal(glm::cross(c[1] - c[0], c[2] - c[0])), normal2(glm::dot(normal, normal)) {}

    // Whether a point of the plane, or one that projects there, is inside the triangle.
    bool covers(const glm::dvec3& point) const {
        for (std::size_t i = 0; i < 3; ++i)
            if (!(glm::dot(glm::cross(corners[(i + 1) % 3] - corners[i], point - corners[i]), normal) >= 0))
                return false;
        return normal2 > 0;
    }
    // The height of a point over the plane, times the length of the normal.
    double height(const glm::dvec3& point) const { return glm::dot(point - corners[0], normal); }

    const TriangleCorners& corners;
    glm::dvec3 normal;
    double normal2;
};

// Where an edge passes through the interior of a triangle.
std::optional<glm::dvec3> crossing(const glm::dvec3& from, const glm::dvec3& to, const Plane& plane) {
    const double before = plane.height(from), after = plane.height(to);
    if (!(before * after < 0)) return std::nullopt;
    const glm::dvec3 at = from + (before / (before - after)) * (to - from);
    return plane.covers(at) ? std::optional(at) : std::nullopt;
}

// The closest pair so far.
class Closest {
  public:
    Closest(const TriangleCorners& a, const TriangleCorners& b) : a_(a), b_(b) {}

    void tryEdges() {
        for (std::size_t i = 0; i < 3; ++i)
            for (std::size_t k = 0; k < 3; ++k) {
                const SegmentPair pair =
                    closestOnSegments(a_[i], a_[(i + 1) % 3] - a_[i], b_[k], b_[(k + 1) % 3] - b_[k]);
                if (pair.distance2 < best_.distance2)
                    best_ = {pair.distance2, onEdge(a_, i, pair.s), onEdge(b_, k, pair.t)};
            }
    }

    void tryCornersOfA(const Plane& b) {
        for (std::size_t i = 0; i < 3; ++i)
            if (const auto foot = footOf(a_[i], b)) take({a_[i], Feature::vertex, std::uint8_t(i)}, {*foot});
    }
    void tryCornersOfB(const Plane& a) {
        for (std::size_t i = 0; i < 3; ++i)
            if (const auto foot = footOf(b_[i], a)) take({*foot}, {b_[i], Feature::vertex, std::uint8_t(i)});
    }

    void tryCrossings(const Plane& a, const Plane& b) {
        for (std::size_t i = 0; i < 3 && best_.distance2 > 0; ++i) {
            const auto next = (i + 1) % 3;
            if (const auto at = crossing(a_[i], a_[next], b)) best_ = {0, {*at, Feature::edge, std::uint8_t(i)}, {*at}};
            if (const auto at = crossing(b_[i], b_[next], a)) best_ = {0, {*at}, {*at, Feature::edge, std::uint8_t(i)}};
        }
    }

    const TrianglePair& best() const { return best_; }

  private:
    // The projection of a point into the interior of a triangle, if it is nearer than the best pair.
    std::optional<glm::dvec3> footOf(const glm::dvec3& point, const Plane& plane) const {
        const double height = plane.height(point);
        if (!(height * height < best_.distance2 * plane.normal2) || !plane.covers(point)) return std::nullopt;
        return point - (height / plane.normal2) * plane.normal;
    }

    void take(const TrianglePoint& a, const TrianglePoint& b) {
        const glm::dvec3 between = a.position - b.position;
        const double distance2 = glm::dot(between, between);
        if (distance2 < best_.distance2) best_ = {distance2, a, b};
    }

    const TriangleCorners &a_, &b_;
    TrianglePair best_{std::numeric_limits<double>::infinity(), {}, {}};
};

}  // namespace

TrianglePair closestPoints(const TriangleCorners& a, const TriangleCorners& b) {
    Closest closest(a, b);
    const Plane planeA(a), planeB(b);
    closest.tryEdges();
    closest.tryCornersOfA(planeB);
    closest.tryCornersOfB(planeA);
    closest.tryCrossings(planeA, planeB);
    return closest.best();
}

}  // namespace bilayer::detail
