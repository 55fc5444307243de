// SPDX-License-Identifier: Apache-2.0
#include "sdf/sign/sign_repair.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/enumerable_thread_specific.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/parallel_reduce.h>
#include <oneapi/tbb/parallel_sort.h>
#include <openvdb/tree/LeafManager.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <functional>
#include <glm/vec2.hpp>
#include <span>
#include <utility>
#include <vector>

#include "sdf/base/line_side.h"
#include "sdf/base/openvdb.h"
#include "sdf/base/progress.h"

namespace bilayer::detail {
namespace {

using Leaf = openvdb::FloatTree::LeafNodeType;
constexpr int side = int(Leaf::DIM), columns = side * side;

/// Voxels closer to the surface than this may have either sign [voxels].
constexpr float onSurface = 1e-3f;

/// Up to this many leaves, all columns are compared at once, in milliseconds.
constexpr openvdb::Index32 fewLeaves = 1024;

/// The columns of a leaf and of all leaves above and below it, encoded by their x and y for sorting.
using Tile = std::uint64_t;

Tile tileAt(std::int64_t x, std::int64_t y) {
    constexpr std::int64_t half = std::int64_t(1) << 31;
    return Tile(x + half) << 32 | Tile(y + half);
}

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

struct TriangleInTile {
    std::uint32_t tile;  ///< index among the tiles with leaves
    std::uint32_t triangle;
};

struct LeafInTile {
    Tile tile;
    Leaf* leaf;
    std::int64_t bottom() const { return leaf->origin().z(); }
    bool operator<(const LeafInTile& other) const {
        return tile != other.tile ? tile < other.tile : bottom() < other.bottom();
    }
};

/// A crossing of a column and a triangle.
struct ColumnCrossing {
    std::int32_t above;   ///< the first voxel above it
    std::uint8_t column;  ///< index in its tile
    std::int8_t sign;     ///< +1: the solid begins there, going up; -1: it ends
};

/// The winding numbers along the columns of a tile, from bottom to top.
class Rise {
  public:
    Rise(float tolerance, float limit) : tolerance_(tolerance), limit_(limit) {}

    /// Compares a leaf, corrects it, and advances to its top.
    /// @param crossings  those between the last leaf's top and this one's
    /// @param asked      the columns to compare
    void repair(Leaf& leaf, std::span<const ColumnCrossing> crossings, std::uint64_t asked, SignRepair& sum) {
        for (const ColumnCrossing& crossing : crossings) {
            const std::int32_t k = std::max(crossing.above - leaf.origin().z(), 0);
            changes_[std::size_t(crossing.column * side + k)] += crossing.sign;
            crossed_ |= std::uint64_t(1) << crossing.column;
        }
        const float* values = leaf.buffer().data();
        for (std::uint64_t rest = asked; rest != 0; rest &= rest - 1) {
            const int column = std::countr_zero(rest);
            const bool crossed = crossed_ >> column & 1;
            const bool isInside = inside_ >> column & 1;
            if (crossed || !allAre(isInside, values + column * side)) repairColumn(leaf, column, crossed, sum);
        }
        crossed_ = 0;
    }

  private:
    static bool allAre(bool inside, const float* values) {
        std::uint32_t differ = 0;
        for (int k = 0; k < side; ++k) differ |= std::bit_cast<std::uint32_t>(values[k]) ^ (inside ? 0x80000000u : 0u);
        return differ >> 31 == 0;
    }

    void repairColumn(Leaf& leaf, int column, bool crossed, SignRepair& sum) {
        std::int32_t& winding = winding_[std::size_t(column)];
        for (int k = 0; k < side; ++k) {
            const int voxel = column * side + k;
            if (crossed) winding += std::exchange(changes_[std::size_t(voxel)], 0);
            float& value = leaf.buffer().data()[voxel];
            if (std::signbit(value) == (winding > 0) || std::abs(value) <= tolerance_) continue;
            if (!leaf.isValueOn(openvdb::Index(voxel))) continue;
            const bool mayFlip = winding >= 0 && std::abs(value) < limit_;
            if (mayFlip) value = -value;
            ++(mayFlip ? sum.repaired : sum.refused);
        }
        const std::uint64_t bit = std::uint64_t(1) << column;
        inside_ = winding > 0 ? inside_ | bit : inside_ & ~bit;
    }

    float tolerance_, limit_;
    std::array<std::int32_t, columns> winding_{};
    std::array<std::int32_t, columns * side> changes_{};  ///< changes of the winding number at the voxels of one leaf
    std::uint64_t inside_ = 0, crossed_ = 0;              ///< one bit per column
};

/// The crossings of a tile's columns, sorted by the leaf that follows them.
struct CrossingsOfTile {
    std::vector<ColumnCrossing> found, sorted;
    std::vector<std::size_t> begins;
};

class Repairer {
  public:
    /// @param fifths  whether to compare only one column in five
    Repairer(openvdb::FloatGrid& distance, const Mesh& mesh, float limit, bool fifths, Progress* progress)
        : mesh_(mesh),
          fifths_(fifths),
          limit_(limit),
          progress_(progress),
          voxelSize_(float(distance.voxelSize()[0])),
          voxelsPerUnit_(1 / double(voxelSize_)) {
        gatherLeaves(distance);
        gatherTriangles();
    }

    SignRepair run() const {
        return tbb::parallel_reduce(
            tbb::blocked_range<std::size_t>(0, tiles_.size()), SignRepair(),
            [&](const auto& range, SignRepair sum) {
                CrossingsOfTile crossings;
                for (std::size_t i = range.begin(); i < range.end(); ++i) {
                    poll(progress_);
                    repairTile(i, crossings, sum);
                }
                return sum;
            },
            [](const SignRepair& a, const SignRepair& b) {
                return SignRepair{a.repaired + b.repaired, a.refused + b.refused};
            });
    }

  private:
    glm::dvec3 corner(std::uint32_t triangle, int k) const {
        return glm::dvec3(mesh_.points[mesh_.triangles[triangle][k]]) * voxelsPerUnit_;
    }

    void gatherLeaves(openvdb::FloatGrid& distance) {
        const openvdb::tree::LeafManager<openvdb::FloatTree> leaves(distance.tree());
        leaves_.reserve(leaves.leafCount());
        for (std::size_t i = 0; i < leaves.leafCount(); ++i) {
            const openvdb::Coord origin = leaves.leaf(i).origin();
            leaves_.push_back({tileAt(origin.x() >> 3, origin.y() >> 3), &leaves.leaf(i)});
        }
        tbb::parallel_sort(leaves_.begin(), leaves_.end());
        for (std::size_t i = 0; i < leaves_.size(); ++i)
            if (i == 0 || leaves_[i].tile != leaves_[i - 1].tile) {
                tiles_.push_back(leaves_[i].tile);
                leavesOfTile_.push_back(i);
            }
        leavesOfTile_.push_back(leaves_.size());
    }

    // Most triangles of a fine mesh lie between columns. The others are sorted by tile.
    void gatherTriangles() {
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

    void addTriangle(std::uint32_t triangle, std::vector<TriangleInTile>& found) const {
        const glm::uvec3& t = mesh_.triangles[triangle];
        const glm::vec3 &a = mesh_.points[t.x], &b = mesh_.points[t.y], &c = mesh_.points[t.z];
        const auto range = [&](int axis) {
            return Interval(double(a[axis]) * voxelsPerUnit_, double(b[axis]) * voxelsPerUnit_,
                            double(c[axis]) * voxelsPerUnit_);
        };
        const Interval x = range(0);
        if (x.empty()) return;
        const Interval y = range(1);
        if (y.empty() || (fifths_ && !anyFifth(x, y))) return;
        for (std::int64_t u = x.first >> 3; u <= x.last >> 3; ++u) {
            auto tile = std::lower_bound(tiles_.begin(), tiles_.end(), tileAt(u, y.first >> 3));
            for (const Tile last = tileAt(u, y.last >> 3); tile != tiles_.end() && *tile <= last; ++tile)
                found.push_back({std::uint32_t(tile - tiles_.begin()), triangle});
        }
    }

    void repairTile(std::size_t tile, CrossingsOfTile& crossings, SignRepair& sum) const {
        const auto leaves =
            std::span(leaves_).subspan(leavesOfTile_[tile], leavesOfTile_[tile + 1] - leavesOfTile_[tile]);
        crossings.found.clear();
        const openvdb::Coord origin = leaves[0].leaf->origin();
        const std::uint64_t asked = fifths_ ? fifthsOf(origin.x(), origin.y()) : ~std::uint64_t(0);
        for (std::size_t t = trianglesOfTile_[tile]; t < trianglesOfTile_[tile + 1]; ++t)
            addCrossings(triangles_[t], origin, asked, crossings.found);
        sortByLeaf(leaves, crossings);
        Rise rise(onSurface * voxelSize_, limit_);
        for (std::size_t i = 0; i < leaves.size(); ++i) {
            const std::size_t begin = crossings.begins[i], end = crossings.begins[i + 1];
            rise.repair(*leaves[i].leaf, std::span(crossings.sorted).subspan(begin, end - begin), asked, sum);
        }
    }

    // The first leaf that a crossing affects is the lowest one whose top is not below it.
    static void sortByLeaf(std::span<const LeafInTile> leaves, CrossingsOfTile& crossings) {
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

    void addCrossings(std::uint32_t triangle, const openvdb::Coord& origin, std::uint64_t asked,
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

    static std::int32_t firstAbove(const glm::dvec3 (&p)[3], const glm::dvec2& at) {
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

    const Mesh& mesh_;
    bool fifths_;  ///< compare only columns with isFifth()
    float limit_;
    Progress* progress_;
    float voxelSize_;
    double voxelsPerUnit_;
    std::vector<LeafInTile> leaves_;            ///< by tile, then from bottom to top
    std::vector<Tile> tiles_;                   ///< those with leaves
    std::vector<std::size_t> leavesOfTile_;     ///< start of each tile's leaves
    std::vector<std::uint32_t> triangles_;      ///< by tile, possibly repeated
    std::vector<std::size_t> trianglesOfTile_;  ///< start of each tile's triangles
};

}  // namespace

SignRepair repairSigns(openvdb::FloatGrid& distance, const Mesh& mesh, float limit, Progress* progress) {
    SignRepair some;
    const bool fifths = distance.tree().leafCount() > fewLeaves;
    if (fifths) {
        some = Repairer(distance, mesh, limit, true, progress).run();
        if (some.repaired + some.refused == 0) return some;
    }
    const SignRepair rest = Repairer(distance, mesh, limit, false, progress).run();
    return {some.repaired + rest.repaired, rest.refused};
}

}  // namespace bilayer::detail
