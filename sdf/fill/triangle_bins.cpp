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
#include "sdf/fill/brick_lattice.h"

namespace bilayer::detail {
namespace {

constexpr std::size_t runsPerThread = 8;    // enough to balance unequal runs
constexpr std::size_t trianglesAhead = 16;  // prefetch distance of corners: about the memory latency

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
    void forEach(const BrickLattice& range, Visit visit) const {
        const std::size_t lowest = code_ >> 3, xStep = std::size_t(range.size.y) * std::size_t(range.size.z);
        for (std::size_t x = 0; x <= ((code_ >> 2) & 1); ++x)
            for (std::size_t y = 0; y <= ((code_ >> 1) & 1); ++y)
                for (std::size_t z = 0; z <= (code_ & 1); ++z)
                    visit(lowest + x * xStep + y * std::size_t(range.size.z) + z);
    }

  private:
    std::uint32_t code_;
};
static_assert(BrickLattice::maxCells < double(1u << 29), "a code holds any cell");

class Binner {
  public:
    Binner(const Mesh& mesh, const Bounds& box, double voxelsPerUnit, float reach, Progress* progress)
        : mesh_(mesh), voxelsPerUnit_(voxelsPerUnit), range_(box, voxelsPerUnit, double(reach)), progress_(progress) {}

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
            bins.origins.push_back((range_.first + range_.place(cell)) * bins.side);
            bins.offsets.push_back(sum);
        }
        return begins;
    }

    // Visits the bricks around a triangle.
    template <class Visit>
    FewBricks visitBricks(std::size_t triangle, Visit visit) const {
        const glm::uvec3 t = mesh_.triangles[triangle];
        const TriangleCorners c{glm::dvec3(mesh_.points[t.x]) * voxelsPerUnit_,
                                glm::dvec3(mesh_.points[t.y]) * voxelsPerUnit_,
                                glm::dvec3(mesh_.points[t.z]) * voxelsPerUnit_};
        const BrickLattice::Range around = range_.around(c);
        if (around.isSmall()) {
            const FewBricks few(range_.cell(around.lower), around.extent());
            few.forEach(range_, visit);
            return few;
        }
        range_.divide(c, around, progress_, [&](const glm::ivec3& brick) { visit(range_.cell(brick)); });
        return FewBricks::many();
    }

    const Mesh& mesh_;
    double voxelsPerUnit_;
    BrickLattice range_;
    Progress* progress_;
};

}  // namespace

TriangleBins binTriangles(const Mesh& mesh, const Bounds& box, double voxelsPerUnit, float reach, Progress* progress) {
    return Binner(mesh, box, voxelsPerUnit, reach, progress).run();
}

int brickSideFor(const Bounds& box, double voxelsPerUnit, float reach) {
    return 1 << BrickLattice(box, voxelsPerUnit, double(reach)).shift;
}

}  // namespace bilayer::detail
