// SPDX-License-Identifier: Apache-2.0
// Branch and bound over the zero set of a field's interpolant: over the cubes of the directory, most of which are
// rejected by their clearances, then cells, then their octants. Lengths in voxels, places from the directory's first
// voxel.
// Tested by tests/collider/zero_set.cpp through Field::closest().
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include "collider/field/layout/interpolant.h"
#include "collider/field/zero/zero_cells.h"
#include "collider/field/zero/zero_cube.h"
#include "collider/field/zero/zero_set.h"

namespace bilayer::detail {

/// Cubes of this side are not subdivided: their diagonal is within zeroTolerance.
inline constexpr double minSide = 1.0 / 2048;
static_assert(double(cellDiagonal) * minSide < zeroTolerance);

/// A cube of 2^level voxels in the directory.
struct DirectoryCube {
    glm::ivec3 lower;
    int level;
};

/// A cell of a stored block.
struct Cell {
    glm::ivec3 voxel;
    std::int32_t entry;
};

/// Finds the point of the zero set with the smallest key. A Query has
///   limit()              only smaller keys matter
///   bound(lower, upper)  a lower bound of the keys in a box; infinite if no point counts
///   bound(cube, limit)   the same for the zeros of a cube; bounds beyond the limit need not be accurate
///   offer(point)         a point of the zero set
///   settle(bound, point) the smallest cube around a point, with a lower bound of its keys
template <class Query>
class ZeroSearch {
  public:
    ZeroSearch(const FieldData& field, Query& query) : field_(field), query_(query), extent_(extentOf(field)) {}

    void run() {
        const auto longest = unsigned(std::max({extent_.x, extent_.y, extent_.z}));
        visit(DirectoryCube{glm::ivec3(0), int(std::bit_width(longest - 1))});
    }

  private:
    template <class Node>
    struct Child {
        double bound;
        Node node;
    };

    // Visits children in ascending order of their bounds, as long as they are below the limit.
    template <class Node, std::size_t max>
    void visitAll(const std::array<Child<Node>, max>& children, std::size_t count) {
        std::array<std::uint8_t, max> order;
        for (std::size_t i = 0; i < count; ++i) {
            std::size_t place = i;
            for (; place > 0 && children[order[place - 1]].bound > children[i].bound; --place)
                order[place] = order[place - 1];
            order[place] = std::uint8_t(i);
        }
        for (std::size_t i = 0; i < count; ++i)
            if (children[order[i]].bound < limit()) visit(children[order[i]].node);
    }

    double limit() const { return query_.limit(); }

    void visit(const DirectoryCube& cube) {
        constexpr int blockLevel = 3, cellLevel = 2;
        if (cube.level == blockLevel && entryAt(field_, cube.lower) < 0) return;
        if (cube.level == cellLevel) return visitCell(cube.lower);
        std::array<Child<DirectoryCube>, 8> children;
        std::size_t count = 0;
        const int level = cube.level - 1, side = 1 << level;
        for (int i = 0; i < 8; ++i) {
            const glm::ivec3 lower = cube.lower + side * glm::ivec3(i >> 2, i >> 1 & 1, i & 1);
            if (lower.x >= extent_.x || lower.y >= extent_.y || lower.z >= extent_.z) continue;
            const glm::dvec3 low(lower), high(glm::min(lower + side, extent_));
            if (isClear(low, high)) continue;
            const double bound = query_.bound(low, high);
            if (bound < limit()) children[count++] = {bound, {lower, level}};
        }
        visitAll(children, count);
    }

    bool isClear(const glm::dvec3& lower, const glm::dvec3& upper) const {
        return clearanceAt(field_, 0.5 * (lower + upper)) > 0.5 * glm::distance(lower, upper);
    }

    // Visits the cells of a coarse cell that contain surface.
    void visitCell(const glm::ivec3& cell) {
        constexpr int side = Clearance::cellSide;
        const std::int32_t entry = entryAt(field_, cell);
        const auto rows = insideRows(field_, entry, cell & 7);
        std::array<Child<Cell>, side * side * side> children;
        std::size_t count = 0;
        for (int x = 0; x < side; ++x)
            for (int y = 0; y < side; ++y) {
                const unsigned some = rows[x][y] | rows[x][y + 1] | rows[x + 1][y] | rows[x + 1][y + 1];
                const unsigned all = rows[x][y] & rows[x][y + 1] & rows[x + 1][y] & rows[x + 1][y + 1];
                const unsigned mixed = (some | some >> 1) & ~(all & all >> 1);
                for (int z = 0; z < side; ++z) {
                    if (!(mixed >> z & 1)) continue;
                    const glm::ivec3 voxel = cell + glm::ivec3(x, y, z);
                    const double bound = query_.bound(glm::dvec3(voxel), glm::dvec3(voxel + 1));
                    if (bound < limit()) children[count++] = {bound, {voxel, entry}};
                }
            }
        visitAll(children, count);
    }

    void visit(const Cell& cell) {
        visit(ZeroCube{glm::dvec3(cell.voxel), 1, cellValues(field_, cell.entry, cell.voxel & 7)});
    }

    void visit(const ZeroCube& cube) {
        const double bound = query_.bound(CubeExpansion(cube), limit());
        if (!(bound < limit())) return;
        const glm::dvec3 point = offerEdges(cube);
        if (cube.side <= minSide) return query_.settle(bound, point);
        if (!(bound < limit())) return;
        visitOctants(cube);
    }

    // Offers the zeros on the edges, where the interpolant is linear: one on each edge whose ends have both signs.
    // Returns one of them.
    glm::dvec3 offerEdges(const ZeroCube& cube) {
        glm::dvec3 point(0);
        for (std::size_t i = 0; i < 8; ++i)
            for (const std::size_t axis : {1, 2, 4}) {
                const double low = cube.values[i], high = cube.values[i | axis];
                if ((i & axis) || (low < 0) == (high < 0)) continue;
                const glm::dvec3 from = cubeCorner(i), to = cubeCorner(i | axis);
                point = cube.lower + cube.side * (from + low / (low - high) * (to - from));
                query_.offer(point);
            }
        return point;
    }

    void visitOctants(const ZeroCube& cube) {
        // the values at the corners of the octants
        std::array<double, 27> grid;
        for (std::size_t i = 0; i < 27; ++i) {
            const std::size_t at[] = {i / 9, i / 3 % 3, i % 3};
            double sum = 0;
            for (std::size_t c = 0; c < 8; ++c) {
                const std::size_t side[] = {c >> 2, c >> 1 & 1, c & 1};
                double weight = 1;
                for (int k = 0; k < 3; ++k) weight *= 0.5 * double(side[k] ? at[k] : 2 - at[k]);
                sum += weight * cube.values[c];
            }
            grid[i] = sum;
        }
        std::array<Child<ZeroCube>, 8> children;
        std::size_t count = 0;
        for (std::size_t i = 0; i < 8; ++i) {
            ZeroCube& octant = children[count].node;
            octant.side = 0.5 * cube.side;
            octant.lower = cube.lower + octant.side * cubeCorner(i);
            const std::size_t first = 9 * (i >> 2) + 3 * (i >> 1 & 1) + (i & 1);
            for (std::size_t c = 0; c < 8; ++c)
                octant.values[c] = grid[first + 9 * (c >> 2) + 3 * (c >> 1 & 1) + (c & 1)];
            if (!octant.holdsZero()) continue;
            children[count].bound = query_.bound(octant.lower, octant.upper());
            if (children[count].bound < limit()) ++count;
        }
        visitAll(children, count);
    }

    const FieldData& field_;
    Query& query_;
    glm::ivec3 extent_;
};

}  // namespace bilayer::detail
