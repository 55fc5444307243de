// SPDX-License-Identifier: Apache-2.0
// The distance of two convex sets by their support points: the algorithm of Gilbert, Johnson and Keerthi ("A fast
// procedure for computing the distance between complex objects in three-dimensional space", IEEE Journal on Robotics
// and Automation 4 (1988) 193-203).
// Tested by tests/collider/shape_distance.cpp.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <limits>

namespace bilayer::detail {

/// A vertex of the simplex: a difference of support points of two sets.
struct SimplexVertex {
    glm::dvec3 ofA{0}, ofB{0};
    int cornerOfA = 0;  ///< a number of the support point of A

    glm::dvec3 difference() const { return ofA - ofB; }
};

/// Up to four differences of support points, with weights: the weighted mean is their point nearest to the origin.
struct Simplex {
    std::array<SimplexVertex, 4> vertices{};
    std::array<double, 4> weights{};
    std::size_t count = 0;

    template <class Member>
    glm::dvec3 mean(Member&& member) const {
        glm::dvec3 sum(0);
        for (std::size_t i = 0; i < count; ++i) sum += weights[i] * member(vertices[i]);
        return sum;
    }
    glm::dvec3 nearest() const {
        return mean([](const SimplexVertex& vertex) { return vertex.difference(); });
    }

    /// Whether no further vertex fits.
    bool isFull() const { return count == vertices.size(); }

    /// Adds a vertex, and keeps the smallest part of the simplex that holds its point nearest to the origin. Requires
    /// !isFull().
    void add(const SimplexVertex& vertex);
};

/// The distance of two convex sets, and their closest points.
struct ConvexPair {
    double distance = std::numeric_limits<double>::infinity();  ///< 0: the sets meet
    glm::dvec3 onA{0}, onB{0};
    Simplex simplex;  ///< the support points that the closest points lie between
};

/// @param supportA   (const glm::dvec3& direction) -> std::pair<glm::dvec3, int>: the farthest point, and its number
/// @param supportB   (const glm::dvec3& direction) -> glm::dvec3
/// @param tolerance  of the distance
/// @param limit      sets that are farther apart get an infinite distance
template <class SupportA, class SupportB>
ConvexPair convexDistance(const SupportA& supportA, const SupportB& supportB, double tolerance, double limit) {
    constexpr int maxIterations = 100;
    const auto supportOf = [&](const glm::dvec3& towardsA) {
        const auto [ofA, corner] = supportA(-towardsA);
        return SimplexVertex{ofA, supportB(towardsA), corner};
    };
    ConvexPair pair;
    Simplex& simplex = pair.simplex;
    simplex.add(supportOf({1, 0, 0}));
    glm::dvec3 towardsA = simplex.nearest();
    double length = glm::length(towardsA);
    // a whole simplex contains the origin, whatever rounding makes of its nearest point
    for (int i = 0; i < maxIterations && length > tolerance && !simplex.isFull(); ++i) {
        const SimplexVertex next = supportOf(towardsA);
        // no point of the difference is nearer than this
        const double bound = glm::dot(next.difference(), towardsA) / length;
        if (bound > limit) return {};
        if (length - bound <= tolerance) break;
        simplex.add(next);
        towardsA = simplex.nearest();
        const double before = length;
        length = glm::length(towardsA);
        // rounding: the simplex gets no nearer
        if (!(length < before)) break;
    }
    pair.distance = length > tolerance && !simplex.isFull() ? length : 0;
    pair.onA = simplex.mean([](const SimplexVertex& vertex) { return vertex.ofA; });
    pair.onB = simplex.mean([](const SimplexVertex& vertex) { return vertex.ofB; });
    return pair;
}

}  // namespace bilayer::detail
