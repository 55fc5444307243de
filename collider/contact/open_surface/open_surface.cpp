// SPDX-License-Identifier: Apache-2.0
#include "collider/contact/open_surface/open_surface.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <map>
#include <optional>
#include <set>
#include <utility>

namespace bilayer::detail {

namespace {

// Minimum mean of the directions from an edge or a vertex into its triangles. The mean is at least this where an edge
// is folded by more than 30 degrees, or a vertex is as sharp.
constexpr float minMean = 0.26f;
// A normal may leave its cone by this tolerance (sine). There is none if the cone is not reached after so many
// projections, or the result is more than 60 degrees from the direction (cosine).
constexpr float coneTolerance = 1e-3f, minConeCosine = 0.5f;
constexpr int maxProjections = 20;
constexpr int maxIntervals = 64;  // maximum count of intervals of a path

/// The end points of an edge in a unique order.
using EdgeKey = std::array<float, 6>;
EdgeKey keyOf(const Triangle& triangle, int edge) {
    const glm::vec3 &a = triangle[edge], &b = triangle[(edge + 1) % 3];
    const EdgeKey key{a.x, a.y, a.z, b.x, b.y, b.z}, back{b.x, b.y, b.z, a.x, a.y, a.z};
    return std::min(key, back);
}

glm::vec3 normalized(const glm::vec3& v) {
    const float length = glm::length(v);
    return length > 0 ? v / length : glm::vec3(0);
}

/// The steepest direction along triangles away from one point of theirs, relative to a given direction.
class Ascent {
  public:
    explicit Ascent(const glm::vec3& direction) : direction_(direction) {}

    /// @param along  of unit length
    void consider(const glm::vec3& along) {
        if (const float rise = glm::dot(along, direction_); rise > rise_) rise_ = rise, part_ = rise * along;
    }
    /// Considers all directions from a vertex into its triangle.
    /// @param one, other  along its two edges there, of unit length
    /// @param conormal    of the first edge
    void considerBetween(const glm::vec3& one, const glm::vec3& other, const glm::vec3& conormal) {
        consider(one);
        consider(other);
        const float ahead = glm::dot(one, direction_), across = glm::dot(conormal, direction_);
        const bool isWithin = across >= 0 && ahead * glm::dot(other, conormal) >= across * glm::dot(other, one);
        if (const float rise = std::hypot(ahead, across); isWithin && rise > rise_)
            rise_ = rise, part_ = ahead * one + across * conormal;
    }

    float rise() const { return rise_; }             ///< sine
    const glm::vec3& part() const { return part_; }  ///< component of the direction along the steepest direction

  private:
    glm::vec3 direction_, part_{0};
    float rise_ = 0;
};

/// The unit vector nearest to a direction from which no direction along the triangles rises. The steepest component is
/// removed until none is left (alternating projections onto half-spaces: L. M. Bregman, Dokl. Akad. Nauk SSSR 162
/// (1965) 487-490).
/// @param visit  passes the directions to an Ascent
template <class Visit>
std::optional<glm::vec3> inNormalCone(const glm::vec3& direction, Visit&& visit) {
    glm::vec3 normal = direction;
    for (int i = 0; i < maxProjections; ++i) {
        Ascent ascent(normal);
        visit(ascent);
        if (ascent.rise() <= coneTolerance) return normal;
        normal = normalized(normal - ascent.part());
        if (!(glm::dot(normal, direction) > minConeCosine)) return std::nullopt;
    }
    return std::nullopt;
}

/// The direction away from all of these together, unless they surround the point.
class OutwardMean {
  public:
    void add(const glm::vec3& direction, float weight) {
        sum_ += weight * direction;
        weight_ += weight;
    }
    std::optional<glm::vec3> outward() const {
        const float length = glm::length(sum_);
        if (!(length > minMean * weight_)) return std::nullopt;
        return -sum_ / length;
    }

  private:
    glm::vec3 sum_{0};
    float weight_ = 0;
};

}  // namespace

glm::vec3 conormalOf(const Triangle& triangle, int edge) {
    const glm::vec3 &from = triangle[edge], &to = triangle[(edge + 1) % 3], &opposite = triangle[(edge + 2) % 3];
    const glm::vec3 along = to - from, inward = opposite - from;
    const float squared = glm::dot(along, along);
    const glm::vec3 across = squared > 0 ? inward - glm::dot(inward, along) / squared * along : inward;
    const float length = glm::length(across);
    return length > 0 ? across / length : glm::vec3(0);
}

Adjacency::Adjacency(std::span<const Triangle> triangles) : triangles_(triangles) {
    edges_ = groupBy([](const Triangle& triangle, int i) { return keyOf(triangle, i); });
    vertices_ = groupBy([](const Triangle& triangle, int i) {
        return std::array{triangle[i].x, triangle[i].y, triangle[i].z};
    });
}

template <class KeyOf>
Adjacency::Groups Adjacency::groupBy(KeyOf&& keyOf) const {
    using Key = decltype(keyOf(triangles_.front(), 0));
    std::vector<std::pair<Key, std::uint32_t>> keys;
    keys.reserve(3 * triangles_.size());
    for (std::uint32_t t = 0; t < triangles_.size(); ++t)
        for (int i = 0; i < 3; ++i) keys.emplace_back(keyOf(triangles_[t], i), 3 * t + std::uint32_t(i));
    std::sort(keys.begin(), keys.end());
    Groups groups;
    groups.first.resize(keys.size());
    groups.end.resize(keys.size());
    for (std::uint32_t first = 0, end = 0; first < keys.size(); first = end) {
        end = first + 1;  // a coordinate that is no number equals nothing, not even itself
        while (end < keys.size() && keys[end].first == keys[first].first) ++end;
        for (std::uint32_t k = first; k < end; ++k) {
            const std::uint32_t at = keys[k].second;
            groups.members.push_back({at / 3, int(at % 3)});
            groups.first[at] = first;
            groups.end[at] = end;
        }
    }
    return groups;
}

std::optional<Conormals> Adjacency::conormalsOf(std::uint32_t triangle, int edge) const {
    const auto both = atEdge(triangle, edge);
    if (both.size() != 2) return std::nullopt;
    const auto conormal = [&](const Member& one) { return conormalOf(triangles_[one.triangle], one.index); };
    return Conormals{conormal(both[0]), conormal(both[1])};
}

std::optional<glm::vec3> Adjacency::neighbourOf(std::uint32_t triangle, int edge) const {
    const auto both = atEdge(triangle, edge);
    if (both.size() != 2) return std::nullopt;
    const Member& other = both[0].triangle == triangle ? both[1] : both[0];
    return conormalOf(triangles_[other.triangle], other.index);
}

std::optional<glm::vec3> Adjacency::edgeNormal(std::uint32_t triangle, int edge, const glm::vec3& direction) const {
    const Triangle& corners = triangles_[triangle];
    const glm::vec3 along = normalized(corners[(edge + 1) % 3] - corners[edge]);
    return inNormalCone(direction, [&](Ascent& ascent) {
        ascent.consider(along);
        ascent.consider(-along);
        for (const Member& one : atEdge(triangle, edge))
            ascent.consider(conormalOf(triangles_[one.triangle], one.index));
    });
}

std::optional<glm::vec3> Adjacency::vertexNormal(std::uint32_t triangle, int vertex, const glm::vec3& direction) const {
    return inNormalCone(direction, [&](Ascent& ascent) {
        for (const auto& [other, i] : groupOf(vertices_, triangle, vertex)) {
            const Triangle& corners = triangles_[other];
            ascent.considerBetween(normalized(corners[(i + 1) % 3] - corners[i]),
                                   normalized(corners[(i + 2) % 3] - corners[i]), conormalOf(corners, i));
        }
    });
}

SharpFeatures sharpFeaturesOf(std::span<const Triangle> triangles) {
    std::map<EdgeKey, OutwardMean> edges;
    std::map<std::array<float, 3>, OutwardMean> vertices;
    for (const Triangle& triangle : triangles)
        for (int i = 0; i < 3; ++i) {
            if (const glm::vec3 conormal = conormalOf(triangle, i); conormal != glm::vec3(0))
                edges[keyOf(triangle, i)].add(conormal, 1);
            const glm::vec3 &here = triangle[i], one = triangle[(i + 1) % 3] - here, two = triangle[(i + 2) % 3] - here;
            if (!(glm::dot(one, one) > 0 && glm::dot(two, two) > 0)) continue;
            const glm::vec3 sum = glm::normalize(one) + glm::normalize(two);
            const float angle = 2 * std::acos(std::min(0.5f * glm::length(sum), 1.f));
            if (angle > 0 && glm::length(sum) > 0) vertices[{here.x, here.y, here.z}].add(glm::normalize(sum), angle);
        }
    SharpFeatures sharp;
    for (const auto& [key, mean] : edges)
        if (const auto outward = mean.outward())
            sharp.edges.push_back({{key[0], key[1], key[2]}, {key[3], key[4], key[5]}, *outward});
    for (const auto& [place, mean] : vertices)
        if (const auto outward = mean.outward()) sharp.vertices.push_back({{place[0], place[1], place[2]}, *outward});
    return sharp;
}

std::vector<Triangle> trianglesAlong(const OpenSurface& openSurface, std::span<const glm::vec3> path, float radius) {
    std::set<std::array<float, 9>> passed;
    std::vector<Triangle> triangles;
    const OpenSurface::Visitor add = [&](const Triangle& triangle, std::uint64_t) {
        const auto& [a, b, c] = triangle;
        if (!isFinite(triangle)) return;
        if (passed.insert({a.x, a.y, a.z, b.x, b.y, b.z, c.x, c.y, c.z}).second) triangles.push_back(triangle);
    };
    for (std::size_t i = 0; i + 1 < path.size(); ++i) {
        const float intervals =
            std::clamp(std::ceil(glm::distance(path[i], path[i + 1]) / (2 * radius)), 1.f, float(maxIntervals));
        for (float k = 0; k < intervals; ++k) {
            const glm::vec3 from = glm::mix(path[i], path[i + 1], k / intervals),
                            to = glm::mix(path[i], path[i + 1], (k + 1) / intervals);
            openSurface.visit({glm::min(from, to) - radius, glm::max(from, to) + radius}, add);
        }
    }
    return triangles;
}

}  // namespace bilayer::detail
