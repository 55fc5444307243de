// SPDX-License-Identifier: Apache-2.0
#include "sdf/fill/triangle_bins.h"

#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <memory>
#include <utility>

#include "sdf/base/progress.h"

namespace bilayer::detail {
namespace {

constexpr int smallestShift = 5;            // bricks of at least 32 voxels a side: their data fits a core's own cache
constexpr double maxCells = 1 << 22;        // maximum cell count, 16 MiB of counters; larger boxes get larger bricks
constexpr std::size_t runsPerThread = 8;    // enough to balance unequal runs
constexpr std::size_t trianglesAhead = 16;  // prefetch distance of corners: about the memory latency

// Rounds down. Faster than std::floor without SSE 4.1. Valid for |value| < 2^31.
int floorToInt(double value) {
    constexpr double shift = 2147483648.0;
    return int(std::int64_t(value + shift) - std::int64_t(shift));
}

glm::ivec3 floorToInt(const glm::dvec3& v) {
    return {floorToInt(v.x), floorToInt(v.y), floorToInt(v.z)};
}

// The range of bricks along each axis.
struct BrickRange {
    BrickRange(const Bounds& box, double voxelsPerUnit, double reach) {
        const glm::dvec3 lower = glm::dvec3(box.lower) * voxelsPerUnit - reach,
                         upper = glm::dvec3(box.upper) * voxelsPerUnit + reach;
        for (shift = smallestShift;; ++shift) {
            first = floorToInt(lower) >> shift;
            size = (floorToInt(upper) >> shift) - first + 1;
            if (double(size.x) * double(size.y) * double(size.z) <= maxCells) return;
        }
    }
    std::size_t cells() const { return std::size_t(size.x) * std::size_t(size.y) * std::size_t(size.z); }
    std::size_t cell(int x, int y, int z) const {
        return (std::size_t(x) * std::size_t(size.y) + std::size_t(y)) * std::size_t(size.z) + std::size_t(z);
    }

    int shift;               // a brick has 2^shift voxels a side
    glm::ivec3 first, size;  // [bricks]
};

// The bricks around a typical triangle: at most two along each axis. Packed into 32 bits, so that they are computed
// only once.
class FewBricks {
  public:
    FewBricks() = default;
    FewBricks(std::size_t lowest, const glm::ivec3& extent)
        : code_(std::uint32_t(lowest) << 3 | unsigned(extent.x > 1) << 2 | unsigned(extent.y > 1) << 1 |
                unsigned(extent.z > 1)) {}
    static FewBricks many() {
        FewBricks code;
        code.code_ = ~0u;
        return code;
    }
    bool areMany() const { return code_ == ~0u; }

    template <class Visit>
    void forEach(const BrickRange& range, Visit visit) const {
        const std::size_t lowest = code_ >> 3, xStep = std::size_t(range.size.y) * std::size_t(range.size.z);
        for (std::size_t x = 0; x <= ((code_ >> 2) & 1); ++x)
            for (std::size_t y = 0; y <= ((code_ >> 1) & 1); ++y)
                for (std::size_t z = 0; z <= (code_ & 1); ++z)
                    visit(lowest + x * xStep + y * std::size_t(range.size.z) + z);
    }

  private:
    std::uint32_t code_;
};
static_assert(maxCells < double(1u << 29), "a code holds any cell");

class Binner {
  public:
    Binner(const Mesh& mesh, const Bounds& box, double voxelsPerUnit, float reach, Progress* progress)
        : mesh_(mesh),
          voxelsPerUnit_(voxelsPerUnit),
          reach_(double(reach)),
          range_(box, voxelsPerUnit, double(reach)),
          progress_(progress) {}

    TriangleBins run() {
        // A counting sort, stable for any run count: count in each run, compute offsets, scatter.
        const std::size_t count = mesh_.triangles.size(), cells = range_.cells();
        const auto threads = std::size_t(tbb::this_task_arena::max_concurrency());
        const std::size_t runs = std::max<std::size_t>(1, std::min({threads * runsPerThread, maxBinCounters / cells,
                                                                    (count + trianglesPerRun - 1) / trianglesPerRun}));
        std::vector<std::uint32_t> cursors(runs * cells, 0);
        const auto codes = std::make_unique_for_overwrite<FewBricks[]>(count);
        const auto forEachTriangle = [&](std::size_t run, auto visit) {
            for (std::size_t i = count * run / runs; i < count * (run + 1) / runs; ++i) {
                if (progress_ && i % trianglesPerPoll == 0) progress_->poll();
                visit(i, cursors.data() + run * cells);
            }
        };
        tbb::parallel_for(std::size_t(0), runs, [&](std::size_t run) {
            forEachTriangle(run, [&](std::size_t i, std::uint32_t* cursor) {
                prefetch(i);
                codes[i] = visitBricks(i, [&](std::size_t cell) { ++cursor[cell]; });
            });
        });
        TriangleBins bins;
        bins.side = 1 << range_.shift;
        std::vector<std::uint64_t> begins = sumUp(cursors, runs, bins);
        bins.triangles.resize(bins.offsets.back());
        tbb::parallel_for(std::size_t(0), runs, [&](std::size_t run) {
            forEachTriangle(run, [&](std::size_t i, std::uint32_t* cursor) {
                const auto put = [&](std::size_t cell) {
                    bins.triangles[begins[cell] + cursor[cell]++] = std::uint32_t(i);
                };
                codes[i].areMany() ? void(visitBricks(i, put)) : codes[i].forEach(range_, put);
            });
        });
        return bins;
    }

  private:
    // In file order, the corners of triangles are scattered in memory.
    void prefetch(std::size_t i) const {
        if (i + trianglesAhead >= mesh_.triangles.size()) return;
        const glm::uvec3& ahead = mesh_.triangles[i + trianglesAhead];
        for (int k = 0; k < 3; ++k) __builtin_prefetch(&mesh_.points[ahead[k]]);
    }

    // Converts counts to offsets. `cursors` receives the offsets within each brick; the result is the start of each
    // cell.
    std::vector<std::uint64_t> sumUp(std::vector<std::uint32_t>& cursors, std::size_t runs, TriangleBins& bins) const {
        const std::size_t cells = range_.cells();
        std::vector<std::uint64_t> begins(cells);
        std::uint64_t sum = 0;
        bins.offsets.push_back(0);
        for (std::size_t cell = 0; cell < cells; ++cell) {
            begins[cell] = sum;
            std::uint32_t inCell = 0;
            for (std::size_t run = 0; run < runs; ++run) inCell += std::exchange(cursors[run * cells + cell], inCell);
            if (inCell == 0) continue;
            sum += inCell;
            bins.origins.push_back((range_.first + place(cell)) * bins.side);
            bins.offsets.push_back(sum);
        }
        return begins;
    }

    glm::ivec3 place(std::size_t cell) const {
        const auto y = std::size_t(range_.size.y), z = std::size_t(range_.size.z);
        return {int(cell / z / y), int(cell / z % y), int(cell % z)};
    }

    // Visits the bricks around a triangle.
    template <class Visit>
    FewBricks visitBricks(std::size_t triangle, Visit visit) const {
        const glm::uvec3 t = mesh_.triangles[triangle];
        const TriangleCorners c{glm::dvec3(mesh_.points[t.x]) * voxelsPerUnit_,
                                glm::dvec3(mesh_.points[t.y]) * voxelsPerUnit_,
                                glm::dvec3(mesh_.points[t.z]) * voxelsPerUnit_};
        const glm::ivec3 lower =
                             (floorToInt(glm::min(c[0], glm::min(c[1], c[2])) - reach_) >> range_.shift) - range_.first,
                         upper =
                             (floorToInt(glm::max(c[0], glm::max(c[1], c[2])) + reach_) >> range_.shift) - range_.first;
        const glm::ivec3 extent = upper - lower + 1;
        if (extent.x <= 2 && extent.y <= 2 && extent.z <= 2) {
            const FewBricks few(range_.cell(lower.x, lower.y, lower.z), extent);
            few.forEach(range_, visit);
            return few;
        }
        divide(c, lower, upper, visit);
        return FewBricks::many();
    }

    // Visits the bricks of a box that a triangle reaches. Bisects boxes of bricks and discards those out of reach. The
    // cost of a needle triangle is thus proportional to its length, not to its box.
    template <class Visit>
    void divide(const TriangleCorners& c, const glm::ivec3& lower, const glm::ivec3& upper, const Visit& visit) const {
        if (staysAway(c, lower, upper)) return;
        const glm::ivec3 size = upper - lower;
        const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
        if (size[axis] == 0) return visit(range_.cell(lower.x, lower.y, lower.z));
        glm::ivec3 middle = upper, next = lower;
        middle[axis] = lower[axis] + size[axis] / 2;
        next[axis] = middle[axis] + 1;
        divide(c, lower, middle, visit);
        divide(c, next, upper, visit);
    }

    // Returns whether a plane separates a triangle from a box of bricks, enlarged by the reach. Separating axis test:
    // the triangle's normal, the axes of the box, and the cross products of edges (S. Gottschalk and others, SIGGRAPH
    // 1996).
    bool staysAway(const TriangleCorners& c, const glm::ivec3& lower, const glm::ivec3& upper) const {
        if (progress_) progress_->poll();
        const double side = double(1 << range_.shift), reach = reach_ + 1;
        const glm::dvec3 low = glm::dvec3(range_.first + lower) * side,
                         high = glm::dvec3(range_.first + upper + 1) * side;
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

    const Mesh& mesh_;
    double voxelsPerUnit_, reach_;
    BrickRange range_;
    Progress* progress_;
};

}  // namespace

TriangleBins binTriangles(const Mesh& mesh, const Bounds& box, double voxelsPerUnit, float reach, Progress* progress) {
    return Binner(mesh, box, voxelsPerUnit, reach, progress).run();
}

int brickSideFor(const Bounds& box, double voxelsPerUnit, float reach) {
    return 1 << BrickRange(box, voxelsPerUnit, double(reach)).shift;
}

}  // namespace bilayer::detail
