// SPDX-License-Identifier: Apache-2.0
#include "sdf/fill/pseudonormal.h"

#include <oneapi/tbb/enumerable_thread_specific.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <bit>
#include <cmath>

#include "sdf/base/progress.h"
#include "sdf/bvh/block_query.h"
#include "sdf/bvh/wide_tree.h"
#include "sdf/leaf/sign_propagation.h"
#include "sdf/sign/closest_side.h"
#include "sdf/sign/fallback_sign.h"

namespace bilayer::detail {
namespace {

/// Side of the cube of blocks that one task fills: large enough to amortize a task, small enough for many tasks
/// [voxels].
constexpr int taskSide = 32;
/// Tolerance of the search for all triangles that can be nearest [voxels].
constexpr float sideSlack = 1e-3f;
/// Maximum node side that opens every node: only leaves remain in the list.
constexpr float openAll = -1;

class PseudonormalFiller {
  public:
    explicit PseudonormalFiller(const MeshJob& job)
        : job_(job),
          tree_(makeWideTree(job.mesh, job.voxelSize, &job.progress)),
          fallbackSign_(job),
          scratch_([&job] { return TaskScratch(job); }) {}

    void fill() {
        const int margin = int(std::ceil(job_.reach)) / blockSide * blockSide + blockSide;
        const glm::ivec3 first(-margin);
        const glm::ivec3 extent = tree_.size + 2 * margin;
        int side = taskSide;
        while (side < std::max({extent.x, extent.y, extent.z})) side *= 2;
        descend(first, side, wholeTree(tree_));
    }

  private:
    // Working memory of a thread.
    struct TaskScratch {
        explicit TaskScratch(const MeshJob& job) : side(job.mesh, 1.0 / double(job.voxelSize)) {}

        NodeList half, block, near;
        BlockAnswer answer;
        ClosestSide side;
        std::vector<glm::ivec3> origins;
        std::vector<float> distances;
        std::vector<std::int32_t> triangles;
    };

    void narrowTo(const NodeList& from, const glm::ivec3& origin, int side, NodeList& to) const {
        const glm::vec3 lower(origin);
        narrow(tree_, from, {lower, lower + float(side - 1)}, job_.reach, float(side), to);
    }

    static glm::ivec3 octant(int i, int side) { return side * glm::ivec3(i >> 2, i >> 1 & 1, i & 1); }

    void descend(const glm::ivec3& origin, int side, const NodeList& list) {
        if (side == taskSide) return fillTask(origin, list);
        tbb::parallel_for(0, 8, [&](int i) {
            const glm::ivec3 child = origin + octant(i, side / 2);
            NodeList narrowed;
            narrowTo(list, child, side / 2, narrowed);
            if (narrowed.count > 0) descend(child, side / 2, narrowed);
        });
    }

    void fillTask(const glm::ivec3& origin, const NodeList& list) {
        TaskScratch& scratch = scratch_.local();
        scratch.origins.clear();
        scratch.distances.clear();
        scratch.triangles.clear();
        scratch.answer.lastWinner = 0;
        for (int i = 0; i < 8; ++i) {
            const glm::ivec3 half = origin + octant(i, taskSide / 2);
            narrowTo(list, half, taskSide / 2, scratch.half);
            if (scratch.half.count == 0) continue;
            for (int j = 0; j < 8; ++j) {
                const glm::ivec3 block = half + octant(j, blockSide);
                narrowTo(scratch.half, block, blockSide, scratch.block);
                if (scratch.block.count > 0) fillBlock(block, scratch);
            }
        }
        if (!scratch.origins.empty()) job_.sink({scratch.origins, scratch.distances, scratch.triangles});
    }

    void fillBlock(const glm::ivec3& block, TaskScratch& scratch) {
        job_.progress.poll();
        BlockAnswer& answer = scratch.answer;
        answerBlock(tree_, scratch.block, glm::vec3(block), job_.reach, job_.sign, answer);
        if (!any(answer.known)) return;
        scratch.origins.push_back(block + tree_.base);
        if (job_.sign) signDistances(block, scratch);
        scratch.distances.insert(scratch.distances.end(), answer.distances, answer.distances + blockVoxels);
        if (job_.triangles)
            scratch.triangles.insert(scratch.triangles.end(), answer.triangles, answer.triangles + blockVoxels);
    }

    // Voxels that project onto a face have a known sign, which links propagate, also beyond the reach. Each remaining
    // component is queried.
    void signDistances(const glm::ivec3& block, TaskScratch& scratch) {
        BlockAnswer& answer = scratch.answer;
        std::size_t onBoth = completeSides(findSignLinks(answer.distances), {&answer.far, &answer.mid, &answer.known},
                                           answer.sides, [&](int voxel) { return isInside(voxel, block, scratch); });
        onBoth += contradictions(block, scratch);
        if (onBoth > 0 && job_.conflicts) *job_.conflicts += onBoth;
        for (std::size_t x = 0; x < answer.sides.inside.size(); ++x)
            for (std::uint64_t inside = answer.sides.inside[x]; inside != 0; inside &= inside - 1)
                answer.distances[x * 64 + std::size_t(std::countr_zero(inside))] *= -1;
    }

    // Counts voxels whose propagated sign differs from their nearest face and from their pseudonormal.
    std::size_t contradictions(const glm::ivec3& block, TaskScratch& scratch) {
        const BlockSides &sides = scratch.answer.sides, &nearest = scratch.answer.nearest;
        std::size_t count = 0;
        for (std::size_t x = 0; x < sides.inside.size(); ++x)
            for (std::uint64_t odd = (sides.outside[x] & nearest.inside[x]) | (sides.inside[x] & nearest.outside[x]);
                 odd != 0; odd &= odd - 1) {
                const int bit = std::countr_zero(odd);
                const bool inside = (sides.inside[x] >> bit & 1) != 0;
                count += isInside(int(x) * 64 + bit, block, scratch) != inside;
            }
        return count;
    }

    // Returns whether a voxel is inside by the pseudonormal at its closest point.
    bool isInside(int voxel, const glm::ivec3& block, TaskScratch& scratch) {
        const glm::ivec3 at = block + glm::ivec3(voxel / 64, voxel / 8 % 8, voxel % 8);
        const glm::dvec3 point(at + tree_.base);
        const float distance = scratch.answer.distances[voxel] + sideSlack;
        narrow(tree_, scratch.block, {glm::vec3(at), glm::vec3(at)}, distance, openAll, scratch.near);
        scratch.side.begin(point);
        for (std::size_t i = 0; i < scratch.near.count; ++i)
            for (const std::uint32_t triangle : tree_.leaves[scratch.near.nodes[i]].triangles)
                scratch.side.offer(triangle);
        const Side side = scratch.side.side();
        return side == Side::undecided ? fallbackSign_.isInside(point * double(job_.voxelSize)) : side == Side::inside;
    }

    const MeshJob& job_;
    WideTree tree_;
    FallbackSign fallbackSign_;
    tbb::enumerable_thread_specific<TaskScratch> scratch_;
};

}  // namespace

void fillPseudonormal(const MeshJob& job) {
    PseudonormalFiller(job).fill();
}

}  // namespace bilayer::detail
