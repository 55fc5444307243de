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
            if (holds(nodes_[node].box, inner)) queue.push({nodes_[node].lastRank, node, noItem});
        };
        if (!items_.empty()) enter(0);
        while (!queue.empty()) {
            const Entry next = queue.top();
            queue.pop();
            if (next.item != noItem) {
                if (!visit(items_[next.item])) return;
                continue;
            }
            const Node& node = nodes_[next.node];
            if (node.right != 0) {
                enter(next.node + 1);
                enter(node.right);
                continue;
            }
            for (std::uint32_t i = node.begin; i < node.end; ++i)
                if (holds(items_[i].box, inner)) queue.push({items_[i].rank, next.node, i});
        }
    }

    /// Calls visit(item) for each box that overlaps a box and has a rank from `first` to `last`, until a call returns
    /// false.
    template <class Visit>
    void forEachOverlap(const Bounds& box, unsigned first, unsigned last, const Visit& visit) const {
        const auto meets = [&](const auto& at) {
            return at.firstRank <= last && at.lastRank >= first && overlap(at.box, box);
        };
        std::vector<std::uint32_t> open;
        if (!items_.empty()) open.push_back(0);
        while (!open.empty()) {
            const std::uint32_t at = open.back();
            const Node& node = nodes_[at];
            open.pop_back();
            if (!meets(node)) continue;
            if (node.right != 0) {
                open.push_back(node.right);
                open.push_back(at + 1);
                continue;
            }
            for (const RankedBox& item : std::span(items_).subspan(node.begin, node.end - node.begin))
                if (item.rank >= first && item.rank <= last && overlap(item.box, box) && !visit(item)) return;
        }
    }

  private:
    static constexpr std::uint32_t noItem = ~0u;

    struct Node {
        Bounds box;
        unsigned firstRank, lastRank;
        std::uint32_t begin, end;  // items
        std::uint32_t right;       // the second child; 0 for a leaf. The first child is the next node.
    };

    void build(std::uint32_t begin, std::uint32_t end);

    std::vector<RankedBox> items_;
    std::vector<Node> nodes_;
};

}  // namespace bilayer::detail
