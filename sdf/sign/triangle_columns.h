// SPDX-License-Identifier: Apache-2.0
// Where a triangle crosses columns of voxels, lines along z through voxel centres.
//
// Columns are exact lines in the lattice. A column that hits an edge counts as displaced by an infinitesimal amount,
// the same for all triangles.
// Tested by tests/sdf/column_sums.cpp.
#pragma once

#include <algorithm>
#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

namespace bilayer::detail {

/// The integers in an interval.
struct IntegerInterval {
    std::int64_t first, last;

    IntegerInterval(std::int64_t from, std::int64_t to) : first(from), last(to) {}
    IntegerInterval(double a, double b, double c) {
        const double low = std::min(std::min(a, b), c), high = std::max(std::max(a, b), c);
        first = std::int64_t(low);
        first += double(first) < low;
        last = std::int64_t(high);
        last -= double(last) > high;
    }
    IntegerInterval within(const IntegerInterval& other) const {
        return {std::max(first, other.first), std::min(last, other.last)};
    }
    bool empty() const { return first > last; }
};

/// The columns that one triangle crosses.
class TriangleColumns {
  public:
    /// Corners [voxels].
    TriangleColumns(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c) : corners_{a, b, c} {}

    IntegerInterval xs() const { return {corners_[0].x, corners_[1].x, corners_[2].x}; }
    IntegerInterval ys() const { return {corners_[0].y, corners_[1].y, corners_[2].y}; }

    /// Returns +1 if the solid begins at the triangle, going up the column, -1 if it ends there, 0 if the column misses
    /// the triangle.
    int crossing(const glm::dvec2& column) const;

    /// Returns the first voxel above the crossing of a column that meets the triangle.
    std::int32_t firstAbove(const glm::dvec2& column) const { return heightAt(column).firstAbove; }

    /// Returns whether rounding cannot have moved firstAbove() by more than one voxel. It may at triangles that are
    /// vertical up to rounding.
    bool isCertain(const glm::dvec2& column) const;

  private:
    struct Height {
        std::int32_t firstAbove;
        double weights;  // twice the area of the triangle's projection, as the sum of three
    };
    Height heightAt(const glm::dvec2& column) const;

    glm::dvec3 corners_[3];
};

}  // namespace bilayer::detail
