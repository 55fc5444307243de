// SPDX-License-Identifier: Apache-2.0
#include "sdf/sign/column_crossings.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/enumerable_thread_specific.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/parallel_sort.h>

#include <algorithm>
#include <cmath>
#include <glm/vec2.hpp>

#include "sdf/base/progress.h"
#include "sdf/sign/triangle_columns.h"

namespace bilayer::detail {
namespace {

constexpr int side = blockSide, columns = int(columnsPerLeaf);

// Returns whether a column is one of every five. Of any column and its four neighbours, exactly one is.
bool isFifth(std::int64_t x, std::int64_t y) {
    return (x + 2 * y) % 5 == 0;
}

bool anyFifth(const IntegerInterval& x, const IntegerInterval& y) {
    for (std::int64_t u = x.first; u <= std::min(x.last, x.first + 4); ++u)
        if (((2 * u - y.first) % 5 + 5) % 5 <= y.last - y.first) return true;
    return false;
}

std::uint64_t fifthsOf(std::int64_t x0, std::int64_t y0) {
    std::uint64_t mask = 0;
    for (int column = 0; column < columns; ++column)
        mask |= std::uint64_t(isFifth(x0 + column / side, y0 + column % side)) << column;
    return mask;
}

}  // namespace

ColumnCrossings::ColumnCrossings(const std::vector<BandLeaf*>& leaves, const Mesh& mesh, double voxelSize,
                                 bool everyFifthColumn, Progress* progress, std::int32_t lowest)
    : mesh_(mesh),
      everyFifthColumn_(everyFifthColumn),
      voxelsPerUnit_(1 / voxelSize),
      progress_(progress),
      lowest_(lowest) {
    gatherLeaves(leaves);
    gatherTriangles();
}

ColumnCrossings::Tile ColumnCrossings::tileAt(std::int64_t x, std::int64_t y) {
    constexpr std::int64_t half = std::int64_t(1) << 31;
    return Tile(x + half) << 32 | Tile(y + half);
}

void ColumnCrossings::gatherLeaves(const std::vector<BandLeaf*>& leaves) {
    leaves_.reserve(leaves.size());
    for (BandLeaf* leaf : leaves) leaves_.push_back({tileAt(leaf->origin().x() >> 3, leaf->origin().y() >> 3), leaf});
    tbb::parallel_sort(leaves_.begin(), leaves_.end());
    for (std::size_t i = 0; i < leaves_.size(); ++i)
        if (i == 0 || leaves_[i].tile != leaves_[i - 1].tile) {
            tiles_.push_back(leaves_[i].tile);
            leavesOfTile_.push_back(i);
        }
    leavesOfTile_.push_back(leaves_.size());
}

// Most triangles of a fine mesh lie between columns. The others are sorted by tile.
void ColumnCrossings::gatherTriangles() {
    tbb::enumerable_thread_specific<std::vector<TriangleInTile>> found;
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, mesh_.triangles.size(), 4096), [&](const auto& range) {
        poll(progress_);
        std::vector<TriangleInTile>& some = found.local();
        for (std::size_t i = range.begin(); i < range.end(); ++i) addTriangle(std::uint32_t(i), some);
    });
    trianglesOfTile_.assign(tiles_.size() + 2, 0);
    for (const auto& some : found)
        for (const TriangleInTile& one : some) ++trianglesOfTile_[one.tile + 2];
    for (std::size_t i = 1; i < trianglesOfTile_.size(); ++i) trianglesOfTile_[i] += trianglesOfTile_[i - 1];
    triangles_.resize(trianglesOfTile_.back());
    for (const auto& some : found)
        for (const TriangleInTile& one : some) triangles_[trianglesOfTile_[one.tile + 1]++] = one.triangle;
}

void ColumnCrossings::addTriangle(std::uint32_t triangle, std::vector<TriangleInTile>& found) const {
    const glm::uvec3& t = mesh_.triangles[triangle];
    const glm::vec3 &a = mesh_.points[t.x], &b = mesh_.points[t.y], &c = mesh_.points[t.z];
    const auto range = [&](int axis) {
        return IntegerInterval(double(a[axis]) * voxelsPerUnit_, double(b[axis]) * voxelsPerUnit_,
                               double(c[axis]) * voxelsPerUnit_);
    };
    const IntegerInterval x = range(0);
    if (x.empty()) return;
    const IntegerInterval y = range(1);
    if (y.empty() || (everyFifthColumn_ && !anyFifth(x, y))) return;
    for (std::int64_t u = x.first >> 3; u <= x.last >> 3; ++u) {
        auto tile = std::lower_bound(tiles_.begin(), tiles_.end(), tileAt(u, y.first >> 3));
        for (const Tile last = tileAt(u, y.last >> 3); tile != tiles_.end() && *tile <= last; ++tile)
            found.push_back({std::uint32_t(tile - tiles_.begin()), triangle});
    }
}

// Returns the columns that were searched.
std::uint64_t ColumnCrossings::find(std::size_t tile, OfTile& crossings) const {
    const auto leaves = std::span(leaves_).subspan(leavesOfTile_[tile], leavesOfTile_[tile + 1] - leavesOfTile_[tile]);
    crossings.found.clear();
    const openvdb::Coord origin = leaves[0].leaf->origin();
    const std::uint64_t asked = everyFifthColumn_ ? fifthsOf(origin.x(), origin.y()) : ~std::uint64_t(0);
    for (std::size_t t = trianglesOfTile_[tile]; t < trianglesOfTile_[tile + 1]; ++t)
        addCrossings(triangles_[t], origin, asked, crossings.found);
    sortByLeaf(leaves, crossings);
    return asked;
}

// The first leaf that a crossing affects is the lowest one whose top is not below it.
void ColumnCrossings::sortByLeaf(std::span<const LeafInTile> leaves, OfTile& crossings) {
    const auto leafOf = [&](const ColumnCrossing& crossing) {
        return std::size_t(
            std::partition_point(leaves.begin(), leaves.end(),
                                 [&](const LeafInTile& one) { return one.bottom() + side <= crossing.above; }) -
            leaves.begin());
    };
    crossings.begins.assign(leaves.size() + 2, 0);
    for (const ColumnCrossing& crossing : crossings.found) ++crossings.begins[leafOf(crossing) + 1];
    for (std::size_t i = 1; i < crossings.begins.size(); ++i) crossings.begins[i] += crossings.begins[i - 1];
    crossings.sorted.resize(crossings.found.size());
    std::vector<std::size_t>& next = crossings.begins;
    for (const ColumnCrossing& crossing : crossings.found) crossings.sorted[next[leafOf(crossing)]++] = crossing;
    next.insert(next.begin(), 0);
}

void ColumnCrossings::addCrossings(std::uint32_t triangle, const openvdb::Coord& origin, std::uint64_t asked,
                                   std::vector<ColumnCrossing>& crossings) const {
    const TriangleColumns crossed(corner(triangle, 0), corner(triangle, 1), corner(triangle, 2));
    const std::int64_t x0 = origin.x(), y0 = origin.y();
    const IntegerInterval xs = crossed.xs().within({x0, x0 + side - 1});
    const IntegerInterval ys = crossed.ys().within({y0, y0 + side - 1});
    for (std::int64_t x = xs.first; x <= xs.last; ++x)
        for (std::int64_t y = ys.first; y <= ys.last; ++y) {
            const std::int64_t column = (x - x0) * side + (y - y0);
            if ((asked >> column & 1) == 0) continue;
            const glm::dvec2 at(x, y);
            const int sign = crossed.crossing(at);
            if (sign == 0) continue;
            const std::int32_t above = crossed.firstAbove(at);
            if (above >= lowest_) crossings.push_back({above, std::uint8_t(column), std::int8_t(sign)});
        }
}

}  // namespace bilayer::detail
