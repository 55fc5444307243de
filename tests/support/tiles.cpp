// SPDX-License-Identifier: Apache-2.0
// Divides triangles into tiles: section 3.2, Algorithm 1 and Fig. 2 of the paper.
#include "tests/support/tiles.h"

#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <numeric>
#include <vector>

#include "sdf/fill/tile_cutter.h"

namespace bilayer {

using namespace bilayer::detail;
namespace {

/// Triangles per task: enough to amortise the cost of a task, few enough for load balance.
constexpr std::size_t grain = 2048;

Tile tileOf(const TilePart& part, float delta, const glm::dvec3& first, const glm::dvec3& down,
            const glm::dvec3& across) {
    const glm::ivec3 base(std::lrint(first.x), std::lrint(first.y), std::lrint(first.z));
    return {base,
            glm::vec3(first - glm::dvec3(base)),
            glm::vec3(down),
            glm::vec3(across),
            glm::vec3(double(delta) * (part.normal / part.length)),
            std::max(part.rows, 1)};
}

// Each sample of a thin part becomes a tile of its own.
template <class Emit>
void makeTilesOf(const TilePart& part, float delta, Emit emit) {
    const TriangleCorners& c = part.corners;
    if (part.rows > 0) {
        const double step = 1.0 / double(part.rows);
        const glm::dvec3 s1 = (c[1] - c[0]) * step, s2 = (c[2] - c[1]) * step, s3 = (c[2] - c[0]) * step;
        return emit(tileOf(part, delta, c[0] + (s1 + s3) / 3.0, s1, s2));
    }
    const ThinPart thin(part);
    for (int k = 0; k < part.along; ++k) {
        const ThinPart::Run run = thin.runFrom(k);
        emit(tileOf(part, delta, run.start + std::min(run.up, run.down) * run.rise, {}, {}));
    }
}

}  // namespace

Tiles makeTiles(const Mesh& mesh, const BuildOptions& options) {
    const double voxels = 1.0 / double(options.voxelSize);
    const auto corners = [&](std::size_t triangle) {
        const glm::uvec3 t = mesh.triangles[triangle];
        return TriangleCorners{glm::dvec3(mesh.points[t.x]) * voxels, glm::dvec3(mesh.points[t.y]) * voxels,
                               glm::dvec3(mesh.points[t.z]) * voxels};
    };
    // each task takes a run of triangles; all runs are processed twice, first to count their tiles, then to store them
    const std::size_t runs = (mesh.triangles.size() + grain - 1) / grain;
    const auto cutRun = [&](std::size_t run, auto emit) {
        std::int32_t triangle = 0;
        TileCutter cutter(options.doubleLayer, nullptr, [&](const TilePart& part) { emit(triangle, part); });
        const std::size_t end = std::min(mesh.triangles.size(), (run + 1) * grain);
        for (std::size_t t = run * grain; t < end; ++t) {
            triangle = std::int32_t(t);
            cutter.cut(corners(t));
        }
    };
    std::vector<std::size_t> begins(runs + 1, 0);
    tbb::parallel_for(std::size_t(0), runs, [&](std::size_t run) {
        std::size_t count = 0;
        cutRun(run, [&](std::int32_t, const TilePart& part) { count += std::size_t(std::max(part.along, 1)); });
        begins[run + 1] = count;
    });
    std::partial_sum(begins.begin(), begins.end(), begins.begin());
    Tiles all;
    const Bounds box = bounds(mesh);
    all.lower = glm::ivec3(glm::floor(glm::dvec3(box.lower) * voxels));
    all.upper = glm::ivec3(glm::ceil(glm::dvec3(box.upper) * voxels));
    all.tileMemory = std::make_unique_for_overwrite<Tile[]>(begins[runs]);
    all.triangleMemory = std::make_unique_for_overwrite<std::int32_t[]>(begins[runs]);
    all.tiles = {all.tileMemory.get(), begins[runs]};
    all.triangles = {all.triangleMemory.get(), begins[runs]};
    tbb::parallel_for(std::size_t(0), runs, [&](std::size_t run) {
        std::size_t at = begins[run];
        cutRun(run, [&](std::int32_t triangle, const TilePart& part) {
            makeTilesOf(part, options.doubleLayer.delta, [&](const Tile& tile) {
                all.tileMemory[at] = tile;
                all.triangleMemory[at++] = triangle;
            });
        });
    });
    return all;
}

}  // namespace bilayer
