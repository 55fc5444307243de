// SPDX-License-Identifier: Apache-2.0
// A search tree over the bounding boxes of the parts of a mesh.
// Tested by tests/sdf/part_nesting.cpp through PartNesting.
#pragma once

#include <cstddef>
#include <cstdint>
#include <queue>
#include <span>
#include <vector>

#include <bilayer/sdf/mesh.h>
#include "sdf/base/box_relations.h"
#include "sdf/bvh/median_tree.h"

namespace bilayer::detail {

/// A part with its bounding box. Ranks order the parts by size: a box within another has the higher rank.
struct RankedBox {
    Bounds box;
    unsigned part, rank;
};

/// A k-d tree in the space of lower and upper corners, so that its nodes hold boxes of similar place and size.
class PartBoxes {
  public:
    explicit PartBoxes(std::vector<RankedBox> items);

    /// Calls visit(item) for each box that holds a box, those of high rank first, until a call returns false.
    template <class Visit>
    void forEachAround(const Bounds& inner, const Visit& visit) const {
        struct Entry {
            unsigned rank;
            std::uint32_t node, item;  // an item, or a node if that is `noItem`
            bool operator<(const Entry& other) const { return rank < other.rank; }
        };
        std::priority_queue<Entry> queue;
        const auto enter = [&](std::uint32_t node) {
            if (holds(tree_[node].box, inner)) queue.push({tree_[node].lastRank, node, noItem});
        };
        if (!items_.empty()) enter(0);
        while (!queue.empty()) {
            const Entry next = queue.top();
            queue.pop();
            if (next.item != noItem) {
                if (!visit(items_[next.item])) return;
                continue;
            }
            if (!tree_.isLeaf(next.node)) {
                enter(tree_.first(next.node));
                enter(tree_.second(next.node));
                continue;
            }
            for (std::uint32_t i = tree_[next.node].begin; i < tree_[next.node].end; ++i)
                if (holds(items_[i].box, inner)) queue.push({items_[i].rank, next.node, i});
        }
    }

    /// Calls visit(item) for each box that overlaps a box and has a rank from `first` to `last`, until a call returns
    /// false.
    template <class Visit>
    void forEachOverlap(const Bounds& box, unsigned first, unsigned last, const Visit& visit) const {
        const auto misses = [&](const Group& group) {
            return group.firstRank > last || group.lastRank < first || !overlap(group.box, box);
        };
        tree_.forEachLeaf(misses, [&](const auto& leaf) {
            for (const RankedBox& item : std::span(items_).subspan(leaf.begin, leaf.end - leaf.begin))
                if (item.rank >= first && item.rank <= last && overlap(item.box, box) && !visit(item)) return false;
            return true;
        });
    }

  private:
    static constexpr std::uint32_t noItem = ~0u;

    /// The box and the ranks of several boxes.
    struct Group {
        Bounds box;
        unsigned firstRank = ~0u, lastRank = 0;
    };

    Group groupOf(std::uint32_t node) const;

    std::vector<RankedBox> items_;
    MedianTree<Group> tree_;
};

}  // namespace bilayer::detail
