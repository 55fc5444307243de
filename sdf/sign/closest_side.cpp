// SPDX-License-Identifier: Apache-2.0
#include "sdf/sign/closest_side.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/constants.hpp>
#include <limits>

namespace bilayer::detail {
namespace {

/// Points this close together coincide [voxels]. The value is far above the rounding of doubles at 1e6 voxels from the
/// origin, and far below the resolution of the field.
constexpr double samePlace = 1e-7;
/// Relative to the sum of their weights: unit normals with a smaller sum nearly cancel out.
constexpr double cancelled = 1e-2;
/// Minimum solid angle, of triangles with sides of about a voxel. Below it, the side on which a path passes an edge is
/// uncertain.
constexpr double tooClose = 1e-9;
constexpr double fullAngle = 2 * glm::pi<double>();

glm::dvec3 closestOnSegment(const glm::dvec3& a, const glm::dvec3& b) {
    const glm::dvec3 ab = b - a;
    const double length2 = glm::dot(ab, ab);
    const double t = length2 > 0 ? std::clamp(-glm::dot(a, ab) / length2, 0.0, 1.0) : 0.0;
    // Computed from the nearer end, so that both triangles of an edge find the same point in either edge direction.
    return t <= 0.5 ? a + t * ab : b - (1 - t) * ab;
}

// Returns the angle that a triangle subtends at one of its points: a full circle in the interior, half of it on an
// edge.
double angleAt(const TriangleCorners& c, const glm::dvec3& p) {
    for (std::size_t i = 0; i < 3; ++i)
        if (glm::distance(c[i], p) <= samePlace) {
            const glm::dvec3 a = c[(i + 1) % 3] - c[i], b = c[(i + 2) % 3] - c[i];
            return std::atan2(glm::length(glm::cross(a, b)), glm::dot(a, b));
        }
    for (std::size_t i = 0; i < 3; ++i) {
        const glm::dvec3 edge = c[(i + 1) % 3] - c[i];
        if (glm::length(glm::cross(edge, p - c[i])) <= samePlace * glm::length(edge)) return glm::pi<double>();
    }
    return fullAngle;
}

// A triangle thinner than samePlace has no reliable normal. The neighbour at its far side also meets the closest point
// and contributes its normal instead.
bool hasNormal(const TriangleCorners& c) {
    return glm::length(glm::cross(c[1] - c[0], c[2] - c[0])) > samePlace * std::sqrt(longestEdge2(c));
}

bool sameCorners(const TriangleCorners& a, const TriangleCorners& b) {
    for (std::size_t shift = 0; shift < 3; ++shift)
        if (a[0] == b[shift] && a[1] == b[(shift + 1) % 3] && a[2] == b[(shift + 2) % 3]) return true;
    return false;
}

}  // namespace

glm::dvec3 closestToOrigin(const TriangleCorners& c) {
    const glm::dvec3 ab = c[1] - c[0], ac = c[2] - c[0], n = glm::cross(ab, ac);
    const double n2 = glm::dot(n, n), longest2 = longestEdge2(c);
    if (n2 > minRelativeHeight * minRelativeHeight * longest2 * longest2) {
        // Projects inside all three edges: the projection onto the plane is the closest point.
        const auto inner = [&](const glm::dvec3& p, const glm::dvec3& q) {
            return glm::dot(glm::cross(q - p, -p), n) >= 0;
        };
        if (inner(c[0], c[1]) && inner(c[1], c[2]) && inner(c[2], c[0])) return (glm::dot(c[0], n) / n2) * n;
    }
    glm::dvec3 best = closestOnSegment(c[0], c[1]);
    for (std::size_t i = 1; i < 3; ++i) {
        const glm::dvec3 other = closestOnSegment(c[i], c[(i + 1) % 3]);
        if (glm::dot(other, other) < glm::dot(best, best)) best = other;
    }
    return best;
}

std::optional<int> segmentCrossing(const TriangleCorners& c, const glm::dvec3& end) {
    const glm::dvec3 n = glm::cross(c[1] - c[0], c[2] - c[0]);
    int positive = 0, negative = 0;
    for (std::size_t i = 0; i < 3; ++i) {
        const glm::dvec3 &a = c[(i + 1) % 3], &b = c[(i + 2) % 3];
        const double volume = glm::dot(end, glm::cross(a, b));
        const double scale = glm::length(end) * glm::length(a) * glm::length(b);
        if (std::abs(volume) > tooClose * scale) ++(volume > 0 ? positive : negative);
    }
    if (positive > 0 && negative > 0) return 0;
    const double from = -glm::dot(c[0], n), to = glm::dot(end, n) + from, flat = tooClose * glm::length(n);
    if ((from > flat && to > flat) || (from < -flat && to < -flat)) return 0;
    if (positive + negative < 3 || std::abs(from) <= flat || std::abs(to) <= flat) return std::nullopt;
    return to > from ? 1 : -1;
}

TriangleCorners ClosestSide::cornersOf(std::uint32_t triangle) const {
    const glm::uvec3 t = mesh_.triangles[triangle];
    const auto corner = [&](unsigned i) { return glm::dvec3(mesh_.points[i]) * voxelsPerUnit_ - point_; };
    return {corner(t.x), corner(t.y), corner(t.z)};
}

void ClosestSide::begin(const glm::dvec3& point) {
    point_ = point;
    distance_ = std::numeric_limits<double>::infinity();
    faces_.clear();
}

void ClosestSide::offer(std::uint32_t triangle) {
    const auto same = [&](const CandidateFace& face) { return face.triangle == triangle; };
    if (std::any_of(faces_.begin(), faces_.end(), same)) return;
    CandidateFace face{triangle, cornersOf(triangle), {}, 0};
    face.closest = closestToOrigin(face.corners);
    face.distance = glm::length(face.closest);
    if (face.distance > distance_ + samePlace) return;
    distance_ = std::min(distance_, face.distance);
    faces_.push_back(face);
}

Side ClosestSide::side() const {
    const auto nearer = [](const CandidateFace& a, const CandidateFace& b) { return a.distance < b.distance; };
    const glm::dvec3 closest = std::min_element(faces_.begin(), faces_.end(), nearer)->closest;
    double sum = 0, weights = 0;
    for (auto face = faces_.begin(); face != faces_.end(); ++face) {
        if (glm::distance(face->closest, closest) > samePlace || !hasNormal(face->corners)) continue;
        const auto duplicate = [&](const CandidateFace& other) { return sameCorners(other.corners, face->corners); };
        if (std::any_of(faces_.begin(), face, duplicate)) continue;
        const auto& c = face->corners;
        const double angle = angleAt(c, closest);
        sum -= angle * glm::dot(glm::normalize(glm::cross(c[1] - c[0], c[2] - c[0])), closest);
        weights += angle;
    }
    if (std::abs(sum) <= cancelled * weights * distance_) return Side::undecided;
    return sum < 0 ? Side::inside : Side::outside;
}

}  // namespace bilayer::detail
