// SPDX-License-Identifier: Apache-2.0
// Closest-triangle search by branch and bound, nearest box first: N. Roussopoulos, S. Kelley, F. Vincent, "Nearest
// neighbor queries", SIGMOD 1995, 71-79. Highway compiles it once for each instruction set.
// Tested by tests/collider/field_closest.cpp through Field::closest().
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "collider/field/triangles/mesh_nearest.cpp"
#include <hwy/cache_control.h>
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <utility>

#include "collider/field/triangles/mesh_tree.h"
#include "collider/field/triangles/tree_place.h"
#include "sdf/bvh/leaf_measure.h"
#include "sdf/bvh/node_stack.h"

HWY_BEFORE_NAMESPACE();
namespace bilayer::detail::HWY_NAMESPACE {

namespace {
/// Count of searches that are interleaved, and of rounds before each runs to its end: enough to hide memory latency,
/// and few enough for the first-level cache.
constexpr std::size_t together = 16;
constexpr int rounds = 3;
constexpr std::size_t cacheLine = 64;  // [bytes]
/// Max rounding of points and oriented boxes in the tree's frame, relative to their size.
constexpr float boxRounding = 5e-7f;

// Prefetches an item.
template <class Item>
inline void fetch(const Item& item) {
    for (std::size_t line = 0; line < sizeof(Item); line += cacheLine)
        hwy::Prefetch(reinterpret_cast<const char*>(&item) + line);
}

// The search for one point below given nodes.
class NearestSearch {
  public:
    void begin(const WideTree& tree, const OrientedBoxes* groups, const glm::dvec3& point, float bound) {
        tree_ = &tree;
        groups_ = groups;
        point_ = SplitPoint(point);
        const float reach = std::min(bound, maxReach);
        best2_ = reach * reach;
        piece_ = MeshTree::noPiece;
    }

    // Visits a node, and all nodes below it that may contain a nearer triangle.
    void visit(std::uint32_t node) {
        if (tree_->isLeaf(node))
            visitLeaf(node);
        else
            descendFrom(node);
    }

    void fetchNode(std::uint32_t node) const {
        if (tree_->isLeaf(node))
            fetch(tree_->leaves[node]);
        else
            fetch(groups_[node - tree_->leafCount]);
    }

    float best2() const { return best2_; }  // squared distance of the nearest triangle, or the squared bound [voxels]
    std::uint32_t piece() const { return piece_; }

  private:
    void descendFrom(std::uint32_t node) {
        const glm::vec3 size = glm::max(glm::abs(point_.cell), glm::vec3(tree_->size));
        const float slack = boxRounding * (size.x + size.y + size.z);  // boxes are rounded, triangles are not
        float limit2 = limit2Of(slack);
        descend(
            *tree_, node, [&](float gap2) { return gap2 > limit2; },
            [&](std::uint32_t group, NodeStack& stack) { open(groups_[group], limit2, stack); },
            [&](std::uint32_t leaf) {
                visitLeaf(leaf);
                limit2 = limit2Of(slack);
                return false;
            });
    }

    // Boxes with a larger squared gap hold no nearer triangle.
    float limit2Of(float slack) const {
        const float limit = std::sqrt(best2_) + slack;
        return limit * limit * roundUp;
    }

    // Pushes the nodes of a group that may contain a nearer triangle, the nearest of them last.
    void open(const OrientedBoxes& group, float limit2, NodeStack& stack) const {
        alignas(64) float gaps[treeWidth];
        // whole voxels first, without rounding
        const glm::vec3 origin(group.origin[0], group.origin[1], group.origin[2]),
            from = (point_.cell - origin) + point_.inCell;
        const Tag tag;
        unsigned near = 0;
        for (std::size_t i = 0; i < treeWidth; i += hn::Lanes(tag)) {
            Vec sum = hn::Zero(tag);
            for (int k = 0; k < 3; ++k) {
                const float(&axis)[3] = group.axes[k];
                const Vec at = hn::Set(tag, axis[0] * from.x + axis[1] * from.y + axis[2] * from.z);
                const Vec gap = hn::Max(hn::Sub(hn::Load(tag, group.lower[k] + i), at),
                                        hn::Sub(at, hn::Load(tag, group.upper[k] + i)));
                sum = hn::Add(sum, square(hn::Max(gap, hn::Zero(tag))));
            }
            hn::Store(sum, tag, gaps + i);
            near |= bitsOf(hn::Le(sum, hn::Set(tag, limit2))) << i;
        }
        if (near == 0) return;
        auto nearest = std::size_t(std::countr_zero(near));
        const auto put = [&](std::size_t i) { stack.push(gaps[i], group.firstChild + std::uint32_t(i)); };
        for (unsigned bits = near & (near - 1); bits != 0; bits &= bits - 1) {
            auto other = std::size_t(std::countr_zero(bits));
            if (gaps[other] < gaps[nearest]) std::swap(other, nearest);
            put(other);
        }
        put(nearest);
    }

    // Branchless: the nearer triangles cannot be predicted.
    void visitLeaf(std::uint32_t index) {
        const WideLeaf& leaf = tree_->leaves[index];
        const Tag tag;
        alignas(64) float distance2[treeWidth];
        Vec smallest = hn::Set(tag, std::numeric_limits<float>::infinity());
        for (std::size_t i = 0; i < treeWidth; i += hn::Lanes(tag)) {
            const auto load = [&](const float* from) { return hn::Load(tag, from + i); };
            const auto from = [&](int k) { return point_.from(leaf, load, k); };
            const Vec measured = measureFromCorner(leaf, load, from(0), from(1), from(2)).distance2;
            hn::Store(measured, tag, distance2 + i);
            smallest = hn::Min(smallest, measured);
        }
        const Vec nearest = hn::MinOfLanes(tag, smallest);
        unsigned found = 0;
        for (std::size_t i = 0; i < treeWidth; i += hn::Lanes(tag))
            found |= bitsOf(hn::Eq(hn::Load(tag, distance2 + i), nearest)) << i;
        const float nearest2 = hn::GetLane(nearest);
        // the bound itself is included
        const bool nearer = piece_ == MeshTree::noPiece ? nearest2 <= best2_ : nearest2 < best2_;
        piece_ = nearer ? index * treeWidth + std::uint32_t(std::countr_zero(found)) : piece_;
        best2_ = nearer ? nearest2 : best2_;
    }

    const WideTree* tree_;
    const OrientedBoxes* groups_;
    SplitPoint point_;
    float best2_;
    std::uint32_t piece_;
};

// The search for one point from a cube's entries. A key holds the squared gap of a node's box, with the entry and slot
// in the lowest bits.
class EntrySearch {
  public:
    void begin(const WideTree& tree, const OrientedBoxes* groups, const glm::dvec3& point, float bound,
               const EntryPlace& place) {
        search_.begin(tree, groups, point, bound);
        entries_ = place.entries;
        places2_ = place.perVoxel * place.perVoxel;
        vectors_ = std::size_t(place.count) * entryVectors;
        for (int i = 0; i < place.count; ++i) measure(entries_[i], place, i);
        key_ = nextKey_ = -1;
        choose();
        choose();
    }

    // Whether an entry's node is left that may contain a nearer triangle.
    bool chosen() const { return isNear(key_); }
    void visitChosen() {
        search_.visit(nodeOf(key_));
        choose();
    }

    std::uint32_t piece() const { return search_.piece(); }

  private:
    using Ints = hn::CappedTag<std::int32_t, treeWidth>;
    static constexpr int slotBits = 3, numberBits = 3, keyBits = slotBits + numberBits, placeBits = 3;
    static constexpr std::int32_t noKey = std::numeric_limits<std::int32_t>::max();
    static_assert(BlockEntry::slots == treeWidth - 1 && treeWidth == 1 << slotBits &&
                  BlockEntries::maxEntries <= 1 << numberBits && BlockEntries::placesPerUnit == 1 << placeBits);
    static constexpr std::size_t lanes = hn::MaxLanes(Ints()), entryVectors = treeWidth / lanes;

    // The last lane has no slot; the bytes loaded there belong to other members.
    void measure(const BlockEntry& entry, const EntryPlace& place, int number) {
        const Ints tag;
        const auto bytes = [&](const std::uint8_t* from) {
            return hn::ShiftLeft<placeBits>(hn::PromoteTo(tag, hn::LoadU(hn::Rebind<std::uint8_t, Ints>(), from)));
        };
        for (std::size_t i = 0; i < treeWidth; i += lanes) {
            auto sum = hn::Zero(tag);
            for (std::size_t k = 0; k < 3; ++k) {
                const auto at = hn::Set(tag, place.place[k]);
                const auto gap =
                    hn::Max(hn::Max(hn::Sub(bytes(entry.lower[k] + i), at), hn::Sub(at, bytes(entry.upper[k] + i))),
                            hn::Zero(tag));
                sum = hn::Add(sum, hn::Mul(gap, gap));
            }
            const auto slot = hn::Iota(tag, std::int32_t(i)), last = hn::Set(tag, BlockEntry::slots);
            const auto key = hn::Or(hn::ShiftLeft<keyBits>(sum), hn::Or(slot, hn::Set(tag, number << slotBits)));
            hn::Store(hn::IfThenElse(hn::Eq(slot, last), hn::Set(tag, noKey), key), tag,
                      keys_ + std::size_t(number) * treeWidth + i);
        }
    }

    std::uint32_t nodeOf(std::int32_t key) const {
        return entries_[key >> slotBits & ((1 << numberBits) - 1)].node(key & ((1 << slotBits) - 1));
    }

    bool isNear(std::int32_t key) const { return key <= (std::int32_t(search_.best2() * places2_) + 1) << keyBits; }

    // Takes the next smallest key, and prefetches the node of the one after it.
    void choose() {
        key_ = nextKey_;
        const Ints tag;
        const auto last = hn::Set(tag, nextKey_), none = hn::Set(tag, noKey);
        auto smallest = none;
        for (std::size_t i = 0; i < vectors_; ++i) {
            const auto keys = hn::Load(tag, keys_ + i * lanes);
            const auto left = hn::IfThenElse(hn::Eq(keys, last), none, keys);
            hn::Store(left, tag, keys_ + i * lanes);
            smallest = hn::Min(smallest, left);
        }
        nextKey_ = hn::GetLane(hn::MinOfLanes(tag, smallest));
        if (isNear(nextKey_)) search_.fetchNode(nodeOf(nextKey_));
    }

    NearestSearch search_;
    const BlockEntry* entries_;
    std::size_t vectors_;  // of keys
    float places2_;
    std::int32_t key_, nextKey_;
    alignas(64) std::int32_t keys_[BlockEntries::maxEntries * treeWidth];
};

std::uint32_t searchAll(const WideTree& tree, const OrientedBoxes* groups, const glm::dvec3& point, float bound) {
    NearestSearch search;
    search.begin(tree, groups, point, bound);
    search.visit(tree.root());
    return search.piece();
}

std::uint32_t searchEntry(const WideTree& tree, const OrientedBoxes* groups, const glm::dvec3& point, float bound,
                          const EntryPlace& place) {
    EntrySearch search;
    search.begin(tree, groups, point, bound, place);
    while (search.chosen()) search.visitChosen();
    return search.piece();
}

// Interleaves the searches of several points, so that prefetches are well ahead of their use.
void searchEntries(const WideTree& tree, const OrientedBoxes* groups, double perMetre,
                   std::span<const glm::vec3> points, float bound, std::span<const EntryPlace> places,
                   std::span<std::uint32_t> pieces) {
    EntrySearch searches[together];
    for (std::size_t first = 0; first < points.size(); first += together) {
        const std::size_t count = std::min(together, points.size() - first);
        for (std::size_t i = 0; i < count; ++i) {
            const glm::dvec3 local = glm::dvec3(points[first + i]) * perMetre - glm::dvec3(tree.base);
            searches[i].begin(tree, groups, local, bound, places[first + i]);
        }
        for (int round = 0; round < rounds; ++round)
            for (std::size_t i = 0; i < count; ++i)
                if (searches[i].chosen()) searches[i].visitChosen();
        for (std::size_t i = 0; i < count; ++i) {
            while (searches[i].chosen()) searches[i].visitChosen();
            pieces[first + i] = searches[i].piece();
        }
    }
}

}  // namespace
}  // namespace bilayer::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bilayer::detail {

HWY_EXPORT(searchAll);
HWY_EXPORT(searchEntry);
HWY_EXPORT(searchEntries);

std::uint32_t MeshTree::nearestPiece(const glm::dvec3& point, float bound) const noexcept {
    const glm::dvec3 from = approached(point);
    const double closer = glm::distance(point, from);
    if (!std::isfinite(closer) || !(double(bound) >= closer * perMetre_)) return noPiece;
    const float left = from == point ? bound : std::numeric_limits<float>::infinity();
    return HWY_DYNAMIC_DISPATCH(searchAll)(tree_, groups_.data(), toTree(from), left);
}

std::uint32_t MeshTree::nearest(const glm::dvec3& point, float bound) const noexcept {
    const std::uint32_t piece = nearestPiece(point, bound);
    return piece == noPiece ? noTriangle : triangleOf(piece);
}

std::uint32_t MeshTree::nearestPiece(const glm::dvec3& point, float bound, const EntryPlace& place) const noexcept {
    return HWY_DYNAMIC_DISPATCH(searchEntry)(tree_, groups_.data(), toTree(point), bound, place);
}

void MeshTree::nearestPieces(std::span<const glm::vec3> points, float bound, std::span<const EntryPlace> places,
                             std::span<std::uint32_t> pieces) const noexcept {
    HWY_DYNAMIC_DISPATCH(searchEntries)(tree_, groups_.data(), perMetre_, points, bound, places, pieces);
}

}  // namespace bilayer::detail
#endif  // HWY_ONCE
