// SPDX-License-Identifier: Apache-2.0
#include "sdf/sign/column_crossings.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/enumerable_thread_specific.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/parallel_sort.h>

#include <algorithm>
#include <cmath>
#include <glm/vec2.hpp>

#include "sdf/base/line_side.h"
#include "sdf/base/progress.h"

namespace bilayer::detail {
namespace {

constexpr int side = blockSide, columns = int(columnsPerLeaf);

/// The integers in an interval.
struct Interval {
    std::int64_t first, last;

    Interval(std::int64_t from, std::int64_t to) : first(from), last(to) {}
    Interval(double a, double b, double c) {
        const double low = std::min(std::min(a, b), c), high = std::max(std::max(a, b), c);
        first = std::int64_t(low);
        first += double(first) < low;
        last = std::int64_t(high);
        last -= double(last) > high;
    }
    Interval within(const Interval& other) const { return {std::max(first, other.first), std::min(last, other.last)}; }
    bool empty() const { return first > last; }
};

// Returns the side of a line on which a column lies; 0 only if the line is degenerate.
int sideOf(const glm::dvec2& a, const glm::dvec2& b, const glm::dvec2& column) {
    if (const int s = lineSide(a, b, column)) return s;
    // Perturbation: infinitesimally toward +x, and by a higher order toward +y.
    if (a.y != b.y) return b.y < a.y ? 1 : -1;
    return b.x > a.x ? 1 : a.x > b.x ? -1 : 0;
}

// Returns whether a column is one of every five. Of any column and its four neighbours, exactly one is.
bool isFifth(std::int64_t x, std::int64_t y) {
    return (x + 2 * y) % 5 == 0;
}

bool anyFifth(const Interval& x, const Interval& y) {
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

std::int32_t firstAbove(const glm::dvec3 (&p)[3], const glm::dvec2& at) {
    double weights = 0, sum = 0;
    for (int k = 0; k < 3; ++k) {
        const glm::dvec2 q = glm::dvec2(p[(k + 1) % 3]) - at, r = glm::dvec2(p[(k + 2) % 3]) - at;
        const double weight = std::abs(q.x * r.y - q.y * r.x);
        weights += weight;
        sum += weight * p[k].z;
    }
    const double low = std::min({p[0].z, p[1].z, p[2].z}), high = std::max({p[0].z, p[1].z, p[2].z});
    return std::int32_t(std::floor(weights > 0 ? std::clamp(sum / weights, low, high) : low)) + 1;
}

}  // namespace

ColumnCrossings::ColumnCrossings(const std::vector<BandLeaf*>& leaves, const Mesh& mesh, double voxelSize,
                                 bool everyFifthColumn, Progress* progress)
    : mesh_(mesh), everyFifthColumn_(everyFifthColumn), voxelsPerUnit_(1 / voxelSize), progress_(progress) {
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
        return Interval(double(a[axis]) * voxelsPerUnit_, double(b[axis]) * voxelsPerUnit_,
                        double(c[axis]) * voxelsPerUnit_);
    };
    const Interval x = range(0);
    if (x.empty()) return;
    const Interval y = range(1);
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
    const glm::dvec3 p[3] = {corner(triangle, 0), corner(triangle, 1), corner(triangle, 2)};
    const glm::dvec2 a(p[0]), b(p[1]), c(p[2]);
    const std::int64_t x0 = origin.x(), y0 = origin.y();
    const Interval xs = Interval(a.x, b.x, c.x).within({x0, x0 + side - 1});
    const Interval ys = Interval(a.y, b.y, c.y).within({y0, y0 + side - 1});
    for (std::int64_t x = xs.first; x <= xs.last; ++x)
        for (std::int64_t y = ys.first; y <= ys.last; ++y) {
            const std::int64_t column = (x - x0) * side + (y - y0);
            if ((asked >> column & 1) == 0) continue;
            const glm::dvec2 at(x, y);
            const int s = sideOf(a, b, at);
            if (s == 0 || sideOf(b, c, at) != s || sideOf(c, a, at) != s) continue;
            // Seen from above, downward-facing triangles are clockwise.
            crossings.push_back({firstAbove(p, at), std::uint8_t(column), std::int8_t(-s)});
        }
}

}  // namespace bilayer::detail
