// SPDX-License-Identifier: Apache-2.0
// Binary trees over items, for queries that sum up what is far: each node has a summary of its items. For boxes of
// triangles see box_tree.h.
// Tested by tests/sdf/winding.cpp through WindingNumber.
#pragma once

#include <oneapi/tbb/parallel_invoke.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <glm/common.hpp>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "sdf/base/progress.h"

namespace bilayer::detail {

/// Smaller ranges of items are processed by one task.
inline constexpr std::size_t medianTreeTask = 4096;

/// Moves the items of lower position along the longest side of their bounds before the middle of a range.
/// @param items  have a position `at` and a unique `index`, which decides between equal positions
template <class Item>
void splitAtMedian(std::span<Item> items, std::size_t middle, Progress* progress) {
    poll(progress);
    glm::vec3 lower = items[0].at, upper = lower;
    for (const Item& item : items) {
        lower = glm::min(lower, item.at);
        upper = glm::max(upper, item.at);
    }
    const glm::vec3 size = upper - lower;
    const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
    const auto less = [axis](const Item& a, const Item& b) {
        return a.at[axis] != b.at[axis] ? a.at[axis] < b.at[axis] : a.index < b.index;
    };
    std::nth_element(items.begin(), items.begin() + std::ptrdiff_t(middle), items.end(), polled(less, progress));
}

/// A balanced binary tree over items that its user keeps. Nodes are in preorder: the first child of a node is the next
/// one, and the second child follows the subtree of the first.
template <class Summary>
class MedianTree {
  public:
    struct Node : Summary {
        std::uint32_t begin, end;  ///< range of items
        std::uint32_t next;        ///< the node after this one's subtree
    };

    /// The count of nodes depends only on that of the items. The place of every node is therefore known before the
    /// nodes are built, in parallel.
    static std::size_t nodeCount(std::size_t items, std::size_t leafItems) {
        if (items <= leafItems) return 1;
        // Halves differ by at most one, so the sizes on a level are two consecutive integers: `fewer` nodes have
        // `small` items, and `more` nodes have one more.
        std::size_t nodes = 0, small = items, fewer = 1, more = 0;
        while (fewer + more > 0) {
            nodes += fewer + more;
            std::size_t nextFewer = 0, nextMore = 0;
            const std::size_t half = small / 2;
            const auto halve = [&](std::size_t size, std::size_t count) {
                if (size <= leafItems) return;
                for (const std::size_t part : {size / 2, size - size / 2})
                    (part == half ? nextFewer : nextMore) += count;
            };
            halve(small, fewer);
            halve(small + 1, more);
            small = half;
            fewer = nextFewer;
            more = nextMore;
        }
        return nodes;
    }

    std::span<const Node> nodes() const { return nodes_; }
    const Node& operator[](std::uint32_t node) const { return nodes_[node]; }
    bool isLeaf(std::uint32_t node) const { return nodes_[node].next == node + 1; }
    static std::uint32_t first(std::uint32_t node) { return node + 1; }
    std::uint32_t second(std::uint32_t node) const { return nodes_[node + 1].next; }

    /// Builds the tree of `items` items, at least one, in parallel if there are many. Throws Cancelled.
    /// @param leafItems  maximum count of items in a leaf
    /// @param split      (begin, middle, end): sorts a range of items into the two halves that children get
    /// @param summarise  (node) -> Summary: called for children before their parent
    /// @param progress   polled, unless null
    template <class Split, class Summarise>
    void build(std::size_t items, std::size_t leafItems, const Split& split, const Summarise& summarise,
               Progress* progress = nullptr) {
        nodes_ = vectorOf<Node>(nodeCount(items, leafItems), progress);
        build(0, 0, items, leafItems, split, summarise);
    }

    /// Visits leaves in order, without allocation.
    /// @param rejects  (const Node&) -> bool: whether a node holds nothing of interest
    /// @param visit    (const Node&) -> bool: for each leaf below no rejected node; false ends the traversal
    template <class Rejects, class Visit>
    void forEachLeaf(const Rejects& rejects, const Visit& visit) const {
        for (std::uint32_t i = 0; i < nodes_.size();) {
            const Node& node = nodes_[i];
            const bool skip = rejects(node);
            if (!skip && isLeaf(i) && !visit(node)) return;
            i = skip ? node.next : i + 1;
        }
    }

  private:
    template <class Split, class Summarise>
    void build(std::size_t at, std::size_t begin, std::size_t end, std::size_t leafItems, const Split& split,
               const Summarise& summarise) {
        Node& node = nodes_[at];
        node.begin = std::uint32_t(begin);
        node.end = std::uint32_t(end);
        node.next = std::uint32_t(at + 1);
        if (end - begin > leafItems) {
            const std::size_t middle = begin + (end - begin) / 2;
            split(begin, middle, end);
            const std::size_t right = at + 1 + nodeCount(middle - begin, leafItems);
            node.next = std::uint32_t(right + nodeCount(end - middle, leafItems));
            const auto first = [&] { build(at + 1, begin, middle, leafItems, split, summarise); };
            const auto second = [&] { build(right, middle, end, leafItems, split, summarise); };
            if (end - begin > medianTreeTask)
                tbb::parallel_invoke(first, second);
            else {
                first();
                second();
            }
        }
        static_cast<Summary&>(node) = summarise(std::uint32_t(at));
    }

    std::vector<Node> nodes_;
};

}  // namespace bilayer::detail
