#include "sdf/triangle_bins.h"

#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <utility>

#include "sdf/progress.h"

namespace bilayer {
namespace {

constexpr int smallestShift = 5;                 // bricks of 32 voxels a side: their work fits a core's own cache
constexpr double cellsAtMost = 1 << 22;          // beyond this bricks are larger: 16 MiB of counters
constexpr std::size_t countersAtMost = 1 << 22;  // over all runs: 16 MiB
constexpr std::size_t trianglesPerRun = 8192;    // what one task bins
constexpr std::size_t runsPerThread = 8;         // enough to share out unequal runs
constexpr std::size_t trianglesPerPoll = 1024;   // tens of microseconds, but for huge triangles
constexpr int bricksWorthCulling = 8;            // a triangle over more bricks than this is tested against each brick

struct Box {
    glm::ivec3 lower, upper;  // both included
};

// Rounds down; quicker than std::floor without SSE 4.1. Right for |value| < 2^31.
int floorToInt(double value) {
    constexpr double shift = 2147483648.0;
    return int(std::int64_t(value + shift) - std::int64_t(shift));
}

glm::ivec3 floorToInt(const glm::dvec3& v) {
    return {floorToInt(v.x), floorToInt(v.y), floorToInt(v.z)};
}

struct Corners {
    glm::dvec3 a, b, c;  // [voxels]
};

class Binner {
  public:
    Binner(const Mesh& mesh, double voxelsPerUnit, float reach)
        : mesh_(mesh), voxelsPerUnit_(voxelsPerUnit), reach_(double(reach)) {
        const Bounds box = bounds(mesh);
        const glm::dvec3 lower = glm::dvec3(box.lower) * voxelsPerUnit - reach_,
                         upper = glm::dvec3(box.upper) * voxelsPerUnit + reach_;
        for (shift_ = smallestShift;; ++shift_) {
            range_ = {floorToInt(lower) >> shift_, floorToInt(upper) >> shift_};
            size_ = range_.upper - range_.lower + 1;
            if (double(size_.x) * double(size_.y) * double(size_.z) <= cellsAtMost) break;
        }
        cells_ = std::size_t(size_.x) * std::size_t(size_.y) * std::size_t(size_.z);
    }

    int side() const { return 1 << shift_; }

    TriangleBins run(Progress* progress) {
        // a counting sort, stable whatever the number of runs: count in each run, sum up, scatter
        const std::size_t count = mesh_.triangles.size();
        const auto threads = std::size_t(tbb::this_task_arena::max_concurrency());
        const std::size_t runs = std::max<std::size_t>(1, std::min({threads * runsPerThread, countersAtMost / cells_,
                                                                    (count + trianglesPerRun - 1) / trianglesPerRun}));
        std::vector<std::uint32_t> cursors(runs * cells_, 0);
        const auto forEachPlace = [&](std::size_t run, auto visit) {
            for (std::size_t i = count * run / runs; i < count * (run + 1) / runs; ++i) {
                if (progress && i % trianglesPerPoll == 0) progress->poll();
                forEachBrick(i, [&](std::size_t cell) { visit(cell, cursors[run * cells_ + cell], i); });
            }
        };
        tbb::parallel_for(std::size_t(0), runs, [&](std::size_t run) {
            forEachPlace(run, [](std::size_t, std::uint32_t& n, std::size_t) { ++n; });
        });
        TriangleBins bins;
        bins.side = side();
        std::vector<std::uint64_t> begins = sumUp(cursors, runs, bins);
        bins.triangles.resize(bins.offsets.back());
        tbb::parallel_for(std::size_t(0), runs, [&](std::size_t run) {
            forEachPlace(run, [&](std::size_t cell, std::uint32_t& n, std::size_t i) {
                bins.triangles[begins[cell] + n++] = std::uint32_t(i);
            });
        });
        return bins;
    }

  private:
    // Turns counts into places: `cursors` become offsets inside their brick, and the result the begin of each cell.
    std::vector<std::uint64_t> sumUp(std::vector<std::uint32_t>& cursors, std::size_t runs, TriangleBins& bins) const {
        std::vector<std::uint64_t> begins(cells_);
        std::uint64_t sum = 0;
        bins.offsets.push_back(0);
        for (std::size_t cell = 0; cell < cells_; ++cell) {
            begins[cell] = sum;
            std::uint32_t inCell = 0;
            for (std::size_t run = 0; run < runs; ++run) inCell += std::exchange(cursors[run * cells_ + cell], inCell);
            if (inCell == 0) continue;
            sum += inCell;
            bins.origins.push_back((range_.lower + place(cell)) * bins.side);
            bins.offsets.push_back(sum);
        }
        return begins;
    }

    glm::ivec3 place(std::size_t cell) const {
        return {int(cell / std::size_t(size_.z) / std::size_t(size_.y)),
                int(cell / std::size_t(size_.z) % std::size_t(size_.y)), int(cell % std::size_t(size_.z))};
    }

    template <class Visit>
    void forEachBrick(std::size_t triangle, Visit visit) const {
        const glm::uvec3 t = mesh_.triangles[triangle];
        const Corners c{glm::dvec3(mesh_.points[t.x]) * voxelsPerUnit_, glm::dvec3(mesh_.points[t.y]) * voxelsPerUnit_,
                        glm::dvec3(mesh_.points[t.z]) * voxelsPerUnit_};
        const glm::ivec3 lower = (floorToInt(glm::min(c.a, glm::min(c.b, c.c)) - reach_) >> shift_) - range_.lower,
                         upper = (floorToInt(glm::max(c.a, glm::max(c.b, c.c)) + reach_) >> shift_) - range_.lower;
        const glm::ivec3 extent = upper - lower + 1;
        const bool large = std::int64_t(extent.x) * extent.y * extent.z > bricksWorthCulling;
        const glm::dvec3 normal = large ? glm::cross(c.b - c.a, c.c - c.a) : glm::dvec3(0);
        for (int x = lower.x; x <= upper.x; ++x)
            for (int y = lower.y; y <= upper.y; ++y)
                for (int z = lower.z; z <= upper.z; ++z) {
                    if (large && planeMisses(c.a, normal, {x, y, z})) continue;
                    visit((std::size_t(x) * std::size_t(size_.y) + std::size_t(y)) * std::size_t(size_.z) +
                          std::size_t(z));
                }
    }

    // Whether the plane of a triangle passes a brick farther away than the reach.
    bool planeMisses(const glm::dvec3& a, const glm::dvec3& normal, const glm::ivec3& cell) const {
        const double half = 0.5 * double(1 << shift_);
        const glm::dvec3 centre = glm::dvec3((range_.lower + cell) * (1 << shift_)) + half;
        const glm::dvec3 spread = glm::abs(normal) * half;
        return std::abs(glm::dot(normal, centre - a)) >
               spread.x + spread.y + spread.z + (reach_ + 1) * glm::length(normal);
    }

    const Mesh& mesh_;
    double voxelsPerUnit_, reach_;
    int shift_ = smallestShift;
    Box range_;  // of all bricks, in bricks
    glm::ivec3 size_;
    std::size_t cells_ = 0;
};

}  // namespace

TriangleBins binTriangles(const Mesh& mesh, double voxelsPerUnit, float reach, Progress* progress) {
    return Binner(mesh, voxelsPerUnit, reach).run(progress);
}

int brickSideFor(const Mesh& mesh, double voxelsPerUnit, float reach) {
    return Binner(mesh, voxelsPerUnit, reach).side();
}

}  // namespace bilayer
