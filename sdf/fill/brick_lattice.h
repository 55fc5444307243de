// SPDX-License-Identifier: Apache-2.0
// The bricks of space around a mesh, and those that a triangle reaches. The bricks depend on the bounds of the mesh
// alone, so that the whole mesh and each part of it are filled by the same bricks.
// Tested by tests/sdf/exact.cpp through build().
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <glm/vector_relational.hpp>

#include <bilayer/sdf/mesh.h>
#include "sdf/base/progress.h"
#include "sdf/base/triangle_corners.h"

namespace bilayer::detail {

/// A box of bricks, cubes of 2^shift voxels a side.
class BrickLattice {
  public:
    static constexpr int minShift = 5;           ///< at least 32 voxels a side: their data fits a core's own cache
    static constexpr double maxCells = 1 << 22;  ///< max brick count, 16 MiB of counters; larger boxes, larger bricks

    /// @param box    bounds of the mesh
    /// @param reach  max distance of a voxel from a triangle that affects it [voxels]
    BrickLattice(const Bounds& box, double voxelsPerUnit, double reach) : reach_(reach) {
        const glm::dvec3 lower = glm::dvec3(box.lower) * voxelsPerUnit - reach,
                         upper = glm::dvec3(box.upper) * voxelsPerUnit + reach;
        for (shift = minShift;; ++shift) {
            first = floorToInt(lower) >> shift;
            size = (floorToInt(upper) >> shift) - first + 1;
            if (double(size.x) * double(size.y) * double(size.z) <= maxCells) return;
        }
    }

    std::size_t cells() const { return std::size_t(size.x) * std::size_t(size.y) * std::size_t(size.z); }
    std::size_t cell(const glm::ivec3& brick) const {
        return (std::size_t(brick.x) * std::size_t(size.y) + std::size_t(brick.y)) * std::size_t(size.z) +
               std::size_t(brick.z);
    }
    glm::ivec3 place(std::size_t cell) const {
        const auto y = std::size_t(size.y), z = std::size_t(size.z);
        return {int(cell / z / y), int(cell / z % y), int(cell % z)};
    }

    /// Bricks relative to the first one, both ends included.
    struct Range {
        glm::ivec3 lower, upper;
        glm::ivec3 extent() const { return upper - lower + 1; }
        /// Returns whether there are at most two along each axis, as around a typical triangle.
        bool isSmall() const { return glm::all(glm::lessThanEqual(extent(), glm::ivec3(2))); }
    };

    /// Returns the bricks around a triangle's box [voxels], enlarged by the reach.
    Range around(const TriangleCorners& c) const {
        return {(floorToInt(glm::min(c[0], glm::min(c[1], c[2])) - reach_) >> shift) - first,
                (floorToInt(glm::max(c[0], glm::max(c[1], c[2])) + reach_) >> shift) - first};
    }

    /// Visits the bricks of a range that a triangle reaches. Bisects boxes of bricks and discards those out of reach.
    /// The cost of a needle triangle is thus proportional to its length, not to its box.
    template <class Visit>
    void divide(const TriangleCorners& c, const Range& range, Progress* progress, const Visit& visit) const {
        poll(progress);
        if (staysAway(c, range)) return;
        const glm::ivec3 extent = range.upper - range.lower;
        const int axis = extent.x >= extent.y && extent.x >= extent.z ? 0 : extent.y >= extent.z ? 1 : 2;
        if (extent[axis] == 0) return visit(range.lower);
        Range low = range, high = range;
        low.upper[axis] = range.lower[axis] + extent[axis] / 2;
        high.lower[axis] = low.upper[axis] + 1;
        divide(c, low, progress, visit);
        divide(c, high, progress, visit);
    }

    int shift;               ///< a brick has 2^shift voxels a side
    glm::ivec3 first, size;  ///< [bricks]

  private:
    // Rounds down. Faster than std::floor without SSE 4.1. Valid for |value| < 2^31.
    static int floorToInt(double value) {
        constexpr double shift = 2147483648.0;
        return int(std::int64_t(value + shift) - std::int64_t(shift));
    }
    static glm::ivec3 floorToInt(const glm::dvec3& v) { return {floorToInt(v.x), floorToInt(v.y), floorToInt(v.z)}; }

    // Returns whether a plane separates a triangle from a box of bricks, enlarged by the reach. Separating axis test:
    // the triangle's normal, the axes of the box, and the cross products of edges (S. Gottschalk and others, SIGGRAPH
    // 1996).
    bool staysAway(const TriangleCorners& c, const Range& range) const {
        const double side = double(1 << shift), reach = reach_ + 1;
        const glm::dvec3 low = glm::dvec3(first + range.lower) * side,
                         high = glm::dvec3(first + range.upper + 1) * side;
        const glm::dvec3 centre = 0.5 * (low + high), half = 0.5 * (high - low);
        const glm::dvec3 a = c[0] - centre, b = c[1] - centre, p = c[2] - centre;
        const auto parts = [&](const glm::dvec3& axis) {
            const double x = glm::dot(axis, a), y = glm::dot(axis, b), z = glm::dot(axis, p);
            const double room = glm::dot(glm::abs(axis), half) + reach * glm::length(axis);
            return std::min({x, y, z}) > room || std::max({x, y, z}) < -room;
        };
        if (parts({1, 0, 0}) || parts({0, 1, 0}) || parts({0, 0, 1}) || parts(glm::cross(b - a, p - a))) return true;
        for (const glm::dvec3& edge : {b - a, p - b, a - p})
            if (parts({0, -edge.z, edge.y}) || parts({edge.z, 0, -edge.x}) || parts({-edge.y, edge.x, 0})) return true;
        return false;
    }

    double reach_;  // [voxels]
};

}  // namespace bilayer::detail
