// SPDX-License-Identifier: Apache-2.0
// Branch and bound over pairs of nodes, nearest pair first, as E. Larsen, S. Gottschalk, M. Lin, D. Manocha, "Fast
// distance queries with rectangular swept sphere volumes", ICRA 2000. Oriented boxes replace their swept rectangles:
// pieces of surfaces that face each other are flat in them, so that their bounds are tight. The search ends early if
// two planes across the direction of the closest pair separate the meshes: then none is closer, as between convex
// bodies. Highway compiles it once for each instruction set.
#include "collider/contact/distance/mesh_distance.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "collider/contact/distance/mesh_distance.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <utility>

#include "collider/contact/distance/node_heights.h"
#include "collider/contact/distance/posed_tree.h"
#include "collider/contact/distance/triangle_distance_lanes.h"

HWY_BEFORE_NAMESPACE();
namespace bilayer::detail::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;
namespace {

/// Pairs that are nearer by less are not looked for [sizes of the meshes]. Boxes are rounded to floats outward.
constexpr double tolerance = 3e-7;
/// Rounds of projection from one mesh to the other for a first bound.
constexpr int projections = 4;
/// Planes are tried after so many opened nodes without a closer pair, which would come with other planes.
constexpr int patience = 8;
/// Planes seldom separate nodes that are larger than this [distances of the closest pair].
constexpr double maxSeparated = 4;

// Lower bounds of the squared distances from a box to the boxes of a group: the largest of the distances of their
// bounds in either frame and along a direction, which points from the group to the box. Returns the slots whose bound
// is below a limit.
unsigned boundDistances(const OrientedBounds& box, const OrientedBoxes& group, const GroupFrame& frame,
                        const glm::dvec3& direction, double limit2, double (&bounds2)[treeWidth]) {
    const hn::CappedTag<double, treeWidth> tag;
    const hn::Rebind<float, decltype(tag)> floats;
    const glm::dmat3 toGroup = glm::transpose(frame.axes), rotated = toGroup * box.axes;
    const glm::dvec3 centre = toGroup * (box.centre - frame.origin);
    glm::dvec3 half(0);
    for (int j = 0; j < 3; ++j) half += glm::abs(rotated[j]) * box.half[j];
    const glm::dvec3 ahead = toGroup * direction;
    const double reachAhead = glm::dot(glm::abs(direction * box.axes), box.half);
    unsigned near = 0;
    const auto zero = hn::Zero(tag), unit = hn::Set(tag, frame.unit), halved = hn::Set(tag, 0.5);
    for (std::size_t i = 0; i < treeWidth; i += hn::Lanes(tag)) {
        auto inGroup2 = zero, inBox2 = zero, farthest2 = zero;
        hn::Vec<decltype(tag)> lowest[3], highest[3], middle[3], extent[3];
        auto used = hn::FirstN(tag, hn::Lanes(tag));
        for (std::size_t k = 0; k < 3; ++k) {
            lowest[k] = hn::Mul(unit, hn::PromoteTo(tag, hn::Load(floats, group.lower[k] + i)));
            highest[k] = hn::Mul(unit, hn::PromoteTo(tag, hn::Load(floats, group.upper[k] + i)));
            used = hn::And(used, hn::Le(lowest[k], highest[k]));
            const auto far = hn::Max(hn::Abs(lowest[k]), hn::Abs(highest[k]));
            farthest2 = hn::Add(farthest2, hn::Mul(far, far));
        }
        const auto growth = hn::Mul(hn::Set(tag, frame.skew), hn::Sqrt(farthest2));
        for (std::size_t k = 0; k < 3; ++k) {
            const auto lower = hn::Sub(lowest[k], growth), upper = hn::Add(highest[k], growth);
            const auto at = hn::Set(tag, centre[int(k)]), reach = hn::Set(tag, half[int(k)]);
            const auto gap =
                hn::Max(hn::Max(hn::Sub(lower, hn::Add(at, reach)), hn::Sub(hn::Sub(at, reach), upper)), zero);
            inGroup2 = hn::Add(inGroup2, hn::Mul(gap, gap));
            middle[k] = hn::Sub(hn::Mul(halved, hn::Add(lower, upper)), at);
            extent[k] = hn::Mul(halved, hn::Sub(upper, lower));
        }
        for (int j = 0; j < 3; ++j) {
            auto along = zero, reach = hn::Set(tag, box.half[j]);
            for (std::size_t k = 0; k < 3; ++k) {
                const auto cosine = hn::Set(tag, rotated[j][int(k)]);
                along = hn::Add(along, hn::Mul(cosine, middle[k]));
                reach = hn::Add(reach, hn::Mul(hn::Abs(cosine), extent[k]));
            }
            const auto gap = hn::Max(hn::Sub(hn::Abs(along), reach), zero);
            inBox2 = hn::Add(inBox2, hn::Mul(gap, gap));
        }
        auto gapAhead = hn::Set(tag, -reachAhead);
        for (std::size_t k = 0; k < 3; ++k) {
            const auto cosine = hn::Set(tag, ahead[int(k)]);
            gapAhead = hn::Sub(gapAhead, hn::Add(hn::Mul(cosine, middle[k]), hn::Mul(hn::Abs(cosine), extent[k])));
        }
        gapAhead = hn::Max(gapAhead, zero);
        const auto bound2 = hn::Max(hn::Max(inGroup2, inBox2), hn::Mul(gapAhead, gapAhead));
        hn::Store(bound2, tag, bounds2 + i);
        std::uint8_t bits[8] = {};
        hn::StoreMaskBits(tag, hn::And(used, hn::Lt(bound2, hn::Set(tag, limit2))), bits);
        near |= unsigned(bits[0]) << i;
    }
    return near;
}

// The triangles of a leaf with their corners.
struct PosedLeaf {
    void take(const PosedTree& mesh, std::uint32_t index) {
        if (index == leaf) return;
        leaf = index;
        count = 0;
        for (const std::uint32_t triangle : LeafTriangles(mesh.tree().leaves[leaf])) {
            indices[count] = triangle;
            corners[count] = mesh.corners(triangle);
            setLanes(count++);
        }
        // lanes without a triangle repeat the last one
        for (std::size_t i = count; i < treeWidth; ++i)
            for (int k = 0; k < 3; ++k)
                for (int axis = 0; axis < 3; ++axis) lanes[k][axis][i] = lanes[k][axis][count - 1];
    }

    std::uint32_t leaf = noTriangle;
    std::size_t count = 0;
    std::array<std::uint32_t, treeWidth> indices;
    std::array<TriangleCorners, treeWidth> corners;
    alignas(64) double lanes[3][3][treeWidth];  // the corners, by corner, then by axis

  private:
    void setLanes(std::size_t i) {
        for (int k = 0; k < 3; ++k)
            for (int axis = 0; axis < 3; ++axis) lanes[k][axis][i] = corners[i][std::size_t(k)][axis];
    }
};

// The triangles of the leaves of a mesh that were measured last.
class LeafCache {
  public:
    const PosedLeaf& of(const PosedTree& mesh, std::uint32_t leaf) {
        PosedLeaf& triangles = leaves_[leaf % leaves_.size()];
        triangles.take(mesh, leaf);
        return triangles;
    }

  private:
    std::array<PosedLeaf, 16> leaves_;
};

// The triangles of a leaf that are nearer to a triangle than a limit, as bits.
unsigned nearerThan(const TriangleCorners& triangle, const PosedLeaf& leaf, double limit2) {
    using D = hn::CappedTag<double, treeWidth>;
    const D tag;
    const CornerLanes<D> one(sameInAll(tag, triangle[0]), sameInAll(tag, triangle[1]), sameInAll(tag, triangle[2]));
    unsigned near = 0;
    for (std::size_t i = 0; i < leaf.count; i += hn::Lanes(tag)) {
        const CornerLanes<D> all(loadLanes(tag, leaf.lanes[0], i), loadLanes(tag, leaf.lanes[1], i),
                                 loadLanes(tag, leaf.lanes[2], i));
        std::uint8_t bits[8] = {};
        hn::StoreMaskBits(tag, hn::Lt(triangleDistance2(tag, one, all), hn::Set(tag, limit2)), bits);
        near |= unsigned(bits[0]) << i;
    }
    return near & ((1u << leaf.count) - 1);
}

class PairSearch {
  public:
    PairSearch(const MeshTree& a, const MeshTree& b, const Similarity& aToB, double maxDistance)
        : a_(a, aToB), b_(b, identity_) {
        rootA_ = {a.tree().root()}, rootB_ = {b.tree().root()};
        margin_ = tolerance * std::sqrt(std::max(a_.boundsOf(rootA_).size2(), b_.boundsOf(rootB_).size2()));
        best_.distance = maxDistance;
        setLimit();
    }

    void startFrom(const TriangleIndices& start) {
        if (start.a < a_.triangleCount() && start.b < b_.triangleCount())
            measure(start.a, a_.corners(start.a), start.b, b_.corners(start.b));
    }

    void startByProjection() {
        glm::dvec3 at = a_.boundsOf(rootA_).centre;
        for (int i = 0; i < projections; ++i) {
            const auto [triangleB, onB] = b_.nearest(at);
            const auto [triangleA, onA] = a_.nearest(onB);
            if (triangleA == noTriangle || triangleB == noTriangle) return;
            const double before = best_.distance;
            measure(triangleA, a_.corners(triangleA), triangleB, b_.corners(triangleB));
            if (i > 0 && !(best_.distance < before)) return;
            at = onA;
        }
    }

    const MeshDistance& run() {
        if (areSeparated(rootA_, rootB_)) return best_;
        stack_.push({0, rootA_, rootB_});
        while (!stack_.isEmpty()) {
            const NodePair pair = stack_.pop();
            if (!(pair.bound < limit2_)) continue;
            const bool leafA = a_.tree().isLeaf(pair.a.index), leafB = b_.tree().isLeaf(pair.b.index);
            if (leafA && leafB) {
                measureLeaves(pair.a.index, pair.b.index);
                continue;
            }
            if (!leafA && !leafB && ++sinceCloser_ > patience) {
                if (sinceCloser_ == patience + 1 && areSeparated(rootA_, rootB_)) return best_;
                if (areSmall(pair) && areSeparated(pair.a, pair.b)) continue;
            }
            if (leafB || (!leafA && a_.size2Of(pair.a) >= b_.size2Of(pair.b)))
                open(a_, pair.a.index, b_.boundsOf(pair.b), -direction_,
                     [&](const PosedNode& child) { return std::pair(child, pair.b); });
            else
                open(b_, pair.b.index, a_.boundsOf(pair.a), direction_,
                     [&](const PosedNode& child) { return std::pair(pair.a, child); });
        }
        return best_;
    }

  private:
    struct NodePair {
        double bound;  // of their squared distance
        PosedNode a, b;
    };

    // Whether planes across the direction of the closest pair show that no pair of triangles below two nodes is closer.
    bool areSeparated(const PosedNode& a, const PosedNode& b) {
        return direction_ != glm::dvec3(0) && heightsA_.of(a_, a.index) + heightsB_.of(b_, b.index) >= limit_;
    }

    bool areSmall(const NodePair& pair) const {
        return std::min(a_.size2Of(pair.a), b_.size2Of(pair.b)) < maxSeparated * maxSeparated * limit2_;
    }

    // Replaces a node by its children that may be near the other one, the nearest last.
    template <class MakePair>
    void open(PosedTree& mesh, std::uint32_t node, const OrientedBounds& other, const glm::dvec3& direction,
              MakePair&& pairOf) {
        const OrientedBoxes& group = mesh.group(node);
        alignas(64) double bounds2[treeWidth];
        unsigned near = boundDistances(other, group, mesh.frameOf(group), direction, limit2_, bounds2);
        stack_.pushSorted([&] {
            for (; near != 0; near &= near - 1) {
                const auto slot = std::uint32_t(std::countr_zero(near));
                const auto [a, b] = pairOf(PosedNode{group.firstChild + slot, &group, slot});
                stack_.push({bounds2[slot], a, b});
            }
        });
    }

    void measureLeaves(std::uint32_t a, std::uint32_t b) {
        const PosedLeaf &ofA = leavesA_.of(a_, a), &ofB = leavesB_.of(b_, b);
        // a copy: measure() changes the direction, and the limits of this leaf must keep to one
        const auto along = [direction = direction_](const TriangleCorners& c) {
            return std::array{glm::dot(direction, c[0]), glm::dot(direction, c[1]), glm::dot(direction, c[2])};
        };
        double farthest = -std::numeric_limits<double>::infinity();
        for (std::size_t k = 0; k < ofB.count; ++k) {
            const auto heights = along(ofB.corners[k]);
            farthest = std::max(farthest, *std::max_element(heights.begin(), heights.end()));
        }
        for (std::size_t i = 0; i < ofA.count; ++i) {
            const auto heights = along(ofA.corners[i]);
            if (!(*std::min_element(heights.begin(), heights.end()) - farthest < limit_)) continue;
            for (unsigned near = nearerThan(ofA.corners[i], ofB, limit2_); near != 0; near &= near - 1) {
                const auto k = std::size_t(std::countr_zero(near));
                measure(ofA.indices[i], ofA.corners[i], ofB.indices[k], ofB.corners[k]);
            }
        }
    }

    void measure(std::uint32_t a, const TriangleCorners& cornersA, std::uint32_t b, const TriangleCorners& cornersB) {
        const TrianglePair pair = closestPoints(cornersA, cornersB);
        if (!(pair.distance2 <= best_.distance * best_.distance)) return;
        best_ = {a, b, pair.a, pair.b, std::sqrt(pair.distance2)};
        if (best_.distance > margin_) setDirection((pair.a.position - pair.b.position) / best_.distance);
        sinceCloser_ = 0;
        setLimit();
    }

    void setDirection(const glm::dvec3& direction) {
        direction_ = direction;
        heightsA_.setDirection(direction);
        heightsB_.setDirection(-direction);
    }

    // Where a pair all but touches, others may intersect: they are looked for.
    void setLimit() {
        limit_ = best_.distance > margin_ ? best_.distance - margin_ : best_.distance;
        limit2_ = limit_ * limit_;
    }

    const Similarity identity_;
    PosedTree a_, b_;
    PosedNode rootA_, rootB_;
    double margin_, limit_, limit2_;
    MeshDistance best_;
    glm::dvec3 direction_{0};          // of the closest pair, from B to A: triangles are no closer than along it
    NodeHeights heightsA_, heightsB_;  // along it, and against it
    int sinceCloser_ = 0;              // nodes opened since the closest pair was found
    LeafCache leavesA_, leavesB_;
    NearestStack<NodePair, 2> stack_;
};

MeshDistance search(const MeshTree& a, const MeshTree& b, const Similarity& aToB, double maxDistance,
                    const TriangleIndices& start) {
    PairSearch search(a, b, aToB, maxDistance);
    if (start.a != noTriangle)
        search.startFrom(start);
    else
        search.startByProjection();
    return search.run();
}

}  // namespace
}  // namespace bilayer::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bilayer::detail {

HWY_EXPORT(search);

MeshDistance distanceBetween(const MeshTree& a, const MeshTree& b, const Similarity& aToB, double maxDistance,
                             const TriangleIndices& start) {
    return HWY_DYNAMIC_DISPATCH(search)(a, b, aToB, maxDistance, start);
}

}  // namespace bilayer::detail
#endif  // HWY_ONCE
