// SPDX-License-Identifier: Apache-2.0
// Highway compiles the part between HWY_BEFORE_NAMESPACE and HWY_AFTER_NAMESPACE once for each instruction set. No sum
// crosses lanes, so all instruction sets give the same bytes.
#include "sdf/bvh/block_query.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "sdf/bvh/block_query.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "sdf/bvh/leaf_measure.h"
#include "sdf/bvh/node_narrowing.h"
#include "sdf/leaf/blocks.h"

HWY_BEFORE_NAMESPACE();
namespace bilayer::detail::HWY_NAMESPACE {
namespace {

/// distanceTie and minFaceHeight hold up to this reach. Beyond, they grow with the reach, like the rounding of
/// distances [voxels].
constexpr float usualReach = 16;
/// Margin for rounding of distances and for ties when a bound is transferred from one point to another [voxels].
constexpr float slack = 1e-3f;
/// The eight corners of a cube, each adjacent to the previous one.
constexpr int path[8][3] = {{0, 0, 0}, {0, 0, 1}, {0, 1, 1}, {0, 1, 0}, {1, 1, 0}, {1, 1, 1}, {1, 0, 1}, {1, 0, 0}};
/// Limits for measuring the eight voxels of a cube together: max count of triangles and of nodes. Above these, it is
/// faster to search for each voxel separately.
constexpr std::size_t maxCandidates = 64, maxNodes = 16;

// The range of a voxel's heights above the triangles that share its closest point. If all heights have the same sign,
// it gives the side of the voxel. A height of 0 marks a triangle with the closest point on one of its edges.
struct Heights {
    float lowest = 0, highest = 0;
    float nearest = 0;  // above the nearest triangle in floats
};

// The query of one voxel.
struct VoxelQuery {
    const WideTree& tree;
    const NodeList& list;
    BlockAnswer& answer;
    float tieWidth;  // distances that differ by less count as equal
    VoxelBox voxel;
    float best2, limit2;  // min squared distance found; boxes farther than `limit2` are skipped
    std::size_t repeats;  // the first `repeats` visits may occur again: the first one was a guess

    void lower(float distance2) {
        best2 = distance2;
        limit2 = best2 * (roundUp + tieWidth) + tieWidth;
    }

    // Restarts without a nearest triangle: visits all leaves that are not visited yet and whose boxes are closer than
    // this.
    void widen(float distance) {
        best2 = 0;
        limit2 = distance * distance * roundUp;
        repeats = answer.visits.size();
    }

    bool wasVisited(std::uint32_t leaf) const {
        for (std::size_t v = 0; v < repeats; ++v)
            if (answer.visits[v].leaf == leaf) return true;
        return false;
    }

    // Computes the squared distances to the triangles of a leaf.
    void visit(std::uint32_t index) {
        const Tag tag;
        const WideLeaf& leaf = tree.leaves[index];
        answer.visits.emplace_back();
        BlockAnswer::Visit& found = answer.visits.back();
        found.leaf = index;
        const glm::vec3 p = voxel.lower;
        float nearest = best2;
        for (std::size_t i = 0; i < treeWidth; i += hn::Lanes(tag)) {
            const auto load = [&](const float* from) { return hn::Load(tag, from + i); };
            const Measured m = measure(leaf, load, hn::Set(tag, p.x), hn::Set(tag, p.y), hn::Set(tag, p.z));
            hn::Store(m.distance2, tag, found.distance2 + i);
            hn::Store(m.height, tag, found.height + i);
            nearest = std::min(nearest, hn::GetLane(hn::MinOfLanes(tag, m.distance2)));
        }
        if (nearest < best2) lower(nearest);
    }

    void search(const BoxArrays& boxes, std::size_t begin, std::size_t count, const std::uint32_t* nodes,
                std::uint32_t firstNode) {
        const Tag tag;
        for (std::size_t i = begin; i < begin + count; i += hn::Lanes(tag)) {
            const Vec distance2 = boxDistance2(boxes.lower, boxes.upper, i, voxel);
            unsigned bits = bitsOf(hn::Le(distance2, hn::Set(tag, limit2)));
            if (begin + count - i < hn::Lanes(tag)) bits &= (1u << (begin + count - i)) - 1;
            if (bits == 0) continue;
            HWY_ALIGN float gaps[treeWidth];
            hn::Store(distance2, tag, gaps);
            for (; bits != 0; bits &= bits - 1) {
                const auto lane = std::size_t(std::countr_zero(bits));
                if (gaps[lane] > limit2) continue;  // something closer was found meanwhile
                const std::uint32_t node = nodes ? nodes[i + lane] : firstNode + std::uint32_t(i + lane);
                if (!tree.isLeaf(node))
                    search(BoxArrays(tree.group(node)), 0, treeWidth, nullptr, tree.group(node).firstChild);
                else if (!wasVisited(node))
                    visit(node);
            }
        }
    }

    // Returns the visit with the nearest triangle, and the triangle's slot in the leaf.
    std::pair<std::size_t, std::size_t> winner() const {
        for (std::size_t v = 0; v < answer.visits.size(); ++v)
            for (std::size_t i = 0; i < treeWidth; ++i)
                if (answer.visits[v].distance2[i] == best2) return {v, i};
        return {0, 0};
    }

    // Returns the range of heights above all faces that share the closest point.
    Heights heights(float nearest) const {
        const Tag tag;
        const Vec infinity = hn::Set(tag, std::numeric_limits<float>::infinity());
        Vec lowest = infinity, highest = hn::Neg(infinity);
        for (const auto& v : answer.visits)
            for (std::size_t i = 0; i < treeWidth; i += hn::Lanes(tag)) {
                const Mask tied = hn::Le(hn::Load(tag, v.distance2 + i), hn::Set(tag, limit2));
                const Vec height = hn::Load(tag, v.height + i);
                lowest = hn::Min(lowest, hn::IfThenElse(tied, height, infinity));
                highest = hn::Max(highest, hn::IfThenElse(tied, height, hn::Neg(infinity)));
            }
        return {hn::GetLane(hn::MinOfLanes(tag, lowest)), hn::GetLane(hn::MaxOfLanes(tag, highest)), nearest};
    }
};

// The eight voxels of a cube of side 2, one per lane, and the triangles that they were measured against.
struct CubeQuery {
    struct Candidate {
        alignas(64) float distance2[treeWidth];
        float height[treeWidth];
        std::int32_t triangle;
    };
    // Results of the nearest triangles of each voxel.
    struct Answers {
        alignas(64) float lowest[treeWidth], highest[treeWidth], winner[treeWidth];
    };

    const WideTree& tree;
    alignas(64) float x[treeWidth], y[treeWidth], z[treeWidth], best2[treeWidth];
    std::size_t count = 0;
    Candidate candidates[maxCandidates];

    CubeQuery(const WideTree& whole, const glm::vec3& lower) : tree(whole) {
        for (int i = 0; i < treeWidth; ++i) {
            x[i] = lower.x + float(path[i][0]);
            y[i] = lower.y + float(path[i][1]);
            z[i] = lower.z + float(path[i][2]);
            best2[i] = std::numeric_limits<float>::max();
        }
    }

    void add(std::uint32_t leafIndex, std::size_t place) {
        const Tag tag;
        const WideLeaf& leaf = tree.leaves[leafIndex];
        Candidate& candidate = candidates[count++];
        candidate.triangle = std::int32_t(leaf.triangles[place]);
        const auto load = [&](const float* from) { return hn::Set(tag, from[place]); };
        for (std::size_t i = 0; i < treeWidth; i += hn::Lanes(tag)) {
            const Measured m = measure(leaf, load, hn::Load(tag, x + i), hn::Load(tag, y + i), hn::Load(tag, z + i));
            hn::Store(m.distance2, tag, candidate.distance2 + i);
            hn::Store(m.height, tag, candidate.height + i);
            hn::Store(hn::Min(m.distance2, hn::Load(tag, best2 + i)), tag, best2 + i);
        }
    }

    // Returns the max over the voxels of the distance to the nearest triangle.
    float farthest() const { return std::sqrt(*std::max_element(best2, best2 + treeWidth)); }

    // Returns the first of the nearest triangles, and the range of heights above all that share the closest point.
    Answers answers(float tieWidth) const {
        const Tag tag;
        Answers found;
        for (std::size_t i = 0; i < treeWidth; i += hn::Lanes(tag)) {
            const Vec best = hn::Load(tag, best2 + i), infinity = hn::Set(tag, std::numeric_limits<float>::infinity());
            const Vec limit = hn::Add(hn::Mul(best, hn::Set(tag, roundUp + tieWidth)), hn::Set(tag, tieWidth));
            Vec lowest = infinity, highest = hn::Neg(infinity), winner = hn::Zero(tag);
            for (std::size_t c = count; c-- > 0;) {
                const Vec distance2 = hn::Load(tag, candidates[c].distance2 + i);
                const Vec height = hn::Load(tag, candidates[c].height + i);
                const Mask tied = hn::Le(distance2, limit);
                lowest = hn::Min(lowest, hn::IfThenElse(tied, height, infinity));
                highest = hn::Max(highest, hn::IfThenElse(tied, height, hn::Neg(infinity)));
                winner = hn::IfThenElse(hn::Eq(distance2, best), hn::Set(tag, float(c)), winner);
            }
            hn::Store(lowest, tag, found.lowest + i);
            hn::Store(highest, tag, found.highest + i);
            hn::Store(winner, tag, found.winner + i);
        }
        return found;
    }
};

// The data that all voxels of a block share.
struct BlockQuery {
    const WideTree& tree;
    const glm::vec3& origin;
    float reach;
    bool sign;
    BlockAnswer& answer;

    // Searches within the distance `bound`.
    VoxelQuery searchWithin(const NodeList& list, const glm::vec3& position, float bound) const {
        const float ties = sign ? distanceTie * std::max(1.f, reach / usualReach) : 0.f;
        VoxelQuery query{tree, list, answer, ties, {position, position}, 0, 0, 1};
        query.lower(bound * bound * roundUp);
        answer.visits.clear();
        query.visit(answer.lastWinner);
        query.search(BoxArrays(list), 0, list.count, list.nodes.data(), 0);
        return query;
    }

    // Answers the voxels of a cube, which are at most `radius` from its centre. The result for the centre excludes most
    // of the list, or all voxels.
    void answerCube(const NodeList& from, const glm::vec3& lower, int level) {
        const float side = float(blockSide >> level), radius = 0.5f * (side - 1) * std::sqrt(3.f) + slack;
        const float bound = reach + radius;
        VoxelQuery centre = searchWithin(from, lower + 0.5f * (side - 1), bound);
        if (!(centre.best2 < bound * bound)) return;
        answer.lastWinner = answer.visits[centre.winner().first].leaf;
        NodeList& list = answer.lists[level];
        const float atMost = std::min(reach, std::sqrt(centre.best2) + radius);
        narrowList(tree, from, {lower, lower + (side - 1)}, atMost + slack, 2 * side, list);
        if (level == 2 && answerAtOnce(centre, list, lower, atMost, radius)) return;
        for (const auto& step : path) {
            const glm::vec3 part = lower + 0.5f * side * glm::vec3(step[0], step[1], step[2]);
            if (level < 2)
                answerCube(list, part, level + 1);
            else
                answerVoxel(list, part, atMost);
        }
    }

    void answerVoxel(const NodeList& list, const glm::vec3& position, float atMost) {
        const VoxelQuery query = searchWithin(list, position, std::min(reach, atMost + slack));
        if (query.best2 > reach * reach * roundUp || answer.visits.empty()) return;
        const auto [visit, place] = query.winner();
        if (answer.visits[visit].distance2[place] != query.best2) return;
        answer.lastWinner = answer.visits[visit].leaf;
        keep(position, query.best2, std::int32_t(tree.leaves[answer.lastWinner].triangles[place]),
             sign ? query.heights(answer.visits[visit].height[place]) : Heights{});
    }

    // Answers the voxels of a cube of side 2 at once, if few triangles are relevant. Triangles are first measured from
    // the centre. Relevant are those whose distance does not exceed the upper bound for the nearest triangle of any
    // voxel.
    bool answerAtOnce(VoxelQuery& centre, const NodeList& list, const glm::vec3& lower, float atMost, float radius) {
        if (list.count > maxNodes) return false;
        CubeQuery cube(tree, lower);
        const auto [visit, place] = centre.winner();
        const std::uint32_t winner = answer.visits[visit].leaf;
        cube.add(winner, place);
        centre.widen(std::min(atMost, cube.farthest()) + radius + slack);
        centre.search(BoxArrays(list), 0, list.count, list.nodes.data(), 0);
        for (const auto& v : answer.visits)
            for (std::size_t i = 0; i < treeWidth; ++i) {
                if (v.distance2[i] > centre.limit2 || (v.leaf == winner && i == place)) continue;
                if (cube.count == maxCandidates) return false;
                cube.add(v.leaf, i);
            }
        const CubeQuery::Answers found = cube.answers(centre.tieWidth);
        for (std::size_t i = 0; i < treeWidth; ++i)
            if (cube.best2[i] <= reach * reach * roundUp) {
                const CubeQuery::Candidate& nearest = cube.candidates[std::size_t(found.winner[i])];
                keep({cube.x[i], cube.y[i], cube.z[i]}, cube.best2[i], nearest.triangle,
                     {found.lowest[i], found.highest[i], nearest.height[i]});
            }
        return true;
    }

    void keep(const glm::vec3& position, float best2, std::int32_t triangle, const Heights& heights) {
        const glm::ivec3 p(position - origin);
        const int voxel = (p.x * blockSide + p.y) * blockSide + p.z;
        const auto x = std::size_t(p.x);
        const std::uint64_t bit = std::uint64_t(1) << (p.y * blockSide + p.z);
        const float distance = std::sqrt(best2);
        answer.distances[voxel] = distance;
        answer.triangles[voxel] = triangle;
        answer.known[x] |= bit;
        if (!sign) return;
        if (distance > farFrom) answer.far[x] |= bit;
        if (distance > midFrom) answer.mid[x] |= bit;
        const float least = minFaceHeight * std::max(1.f, reach / usualReach);
        // on the surface either side is correct, and no link propagates it
        if (heights.lowest > least || distance < 0.5f * linkSlack) answer.sides.outside[x] |= bit;
        if (heights.highest < -least) answer.sides.inside[x] |= bit;
        if (heights.nearest > least) answer.nearest.outside[x] |= bit;
        if (heights.nearest < -least) answer.nearest.inside[x] |= bit;
    }
};

void answerVoxels(const WideTree& tree, const NodeList& list, const glm::vec3& origin, float reach, bool sign,
                  BlockAnswer& answer) {
    answer.known = answer.far = answer.mid = {};
    answer.sides = answer.nearest = {};
    std::fill_n(answer.distances, blockVoxels, farAway);
    std::fill_n(answer.triangles, blockVoxels, -1);
    BlockQuery{tree, origin, reach, sign, answer}.answerCube(list, origin, 0);
}

}  // namespace
}  // namespace bilayer::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bilayer::detail {

HWY_EXPORT(answerVoxels);

void answerBlock(const WideTree& tree, const NodeList& list, const glm::vec3& origin, float reach, bool sign,
                 BlockAnswer& answer) {
    HWY_DYNAMIC_DISPATCH(answerVoxels)(tree, list, origin, reach, sign, answer);
}

}  // namespace bilayer::detail
#endif  // HWY_ONCE
