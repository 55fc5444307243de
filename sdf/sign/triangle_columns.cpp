// SPDX-License-Identifier: Apache-2.0
#include "sdf/sign/triangle_columns.h"

#include <cmath>
#include <cstddef>
#include <glm/geometric.hpp>

#include "sdf/base/line_side.h"

namespace bilayer::detail {
namespace {

/// Above the rounding of a height: the weights are wrong by less than this share of the squared distances to the
/// corners, and they move the height by at most that share of their sum, times the triangle's height. 2^-51 for each
/// of three weights, and as much again for a margin.
constexpr double weightRounding = 1.0 / (std::int64_t(1) << 48);
/// A height that is wrong by less stays next to the crossing [voxels].
constexpr double maxHeightError = 0.5;

// Returns the side of a line on which a column lies; 0 only if the line is degenerate.
int sideOf(const glm::dvec2& a, const glm::dvec2& b, const glm::dvec2& column) {
    if (const int s = lineSide(a, b, column)) return s;
    // Perturbation: infinitesimally toward +x, and by a higher order toward +y.
    if (a.y != b.y) return b.y < a.y ? 1 : -1;
    return b.x > a.x ? 1 : a.x > b.x ? -1 : 0;
}

}  // namespace

int TriangleColumns::crossing(const glm::dvec2& column) const {
    const glm::dvec2 a(corners_[0]), b(corners_[1]), c(corners_[2]);
    const int s = sideOf(a, b, column);
    if (s == 0 || sideOf(b, c, column) != s || sideOf(c, a, column) != s) return 0;
    // Seen from above, downward-facing triangles are clockwise.
    return -s;
}

TriangleColumns::Height TriangleColumns::heightAt(const glm::dvec2& column) const {
    const auto& p = corners_;
    double weights = 0, sum = 0;
    for (int k = 0; k < 3; ++k) {
        const glm::dvec2 q = glm::dvec2(p[(k + 1) % 3]) - column, r = glm::dvec2(p[(k + 2) % 3]) - column;
        const double weight = std::abs(q.x * r.y - q.y * r.x);
        weights += weight;
        sum += weight * p[k].z;
    }
    const double low = std::min({p[0].z, p[1].z, p[2].z}), high = std::max({p[0].z, p[1].z, p[2].z});
    return {std::int32_t(std::floor(weights > 0 ? std::clamp(sum / weights, low, high) : low)) + 1, weights};
}

bool TriangleColumns::isCertain(const glm::dvec2& column) const {
    const auto& p = corners_;
    const double height = std::max({p[0].z, p[1].z, p[2].z}) - std::min({p[0].z, p[1].z, p[2].z});
    double squares = 0;
    for (const glm::dvec3& corner : p) {
        const glm::dvec2 away = glm::dvec2(corner) - column;
        squares += glm::dot(away, away);
    }
    return weightRounding * squares * height <= maxHeightError * heightAt(column).weights;
}

}  // namespace bilayer::detail
