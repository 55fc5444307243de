// SPDX-License-Identifier: Apache-2.0
// Binary trees over items with positions. A node's first child is the next node, and the count of nodes depends only on
// the count of items. The place of every node is therefore known before the nodes are built, in parallel.
// Tested by tests/sdf/winding.cpp.
#pragma once

#include <oneapi/tbb/parallel_invoke.h>

#include <algorithm>
#include <cstddef>
#include <glm/common.hpp>
#include <glm/vec3.hpp>
#include <vector>

#include "sdf/base/progress.h"

namespace bilayer::detail {

/// Smaller ranges of items are processed by one task.
inline constexpr std::size_t medianTreeTask = 4096;

/// Splits a range of items at the median along the longest side of their bounds. Returns the middle.
/// @param items  have a position `at` and a unique `index`, which decides between equal positions
template <class Item>
std::size_t splitAtMedian(std::vector<Item>& items, std::size_t begin, std::size_t end, Progress* progress) {
    poll(progress);
    glm::vec3 lower = items[begin].at, upper = lower;
    for (std::size_t i = begin; i < end; ++i) {
        lower = glm::min(lower, items[i].at);
        upper = glm::max(upper, items[i].at);
    }
    const glm::vec3 size = upper - lower;
    const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
    const std::size_t middle = begin + (end - begin) / 2;
    const auto less = [axis](const Item& a, const Item& b) {
        return a.at[axis] != b.at[axis] ? a.at[axis] < b.at[axis] : a.index < b.index;
    };
    std::nth_element(items.begin() + std::ptrdiff_t(begin), items.begin() + std::ptrdiff_t(middle),
                     items.begin() + std::ptrdiff_t(end), polled(less, progress));
    return middle;
}

/// Returns the node count of the tree over `items` items, with at most `leaf` items per leaf.
inline std::size_t medianTreeNodes(std::size_t items, std::size_t leaf) {
    if (items <= leaf) return 1;
    // Halves differ by at most one, so the sizes on a level are two consecutive integers.
    std::size_t nodes = 0, small = items, fewer = 1, more = 0;  // `fewer` nodes of `small` items, `more` of small + 1
    while (fewer + more > 0) {
        nodes += fewer + more;
        std::size_t nextFewer = 0, nextMore = 0;
        const std::size_t half = small / 2;
        const auto halve = [&](std::size_t size, std::size_t count) {
            if (size <= leaf) return;
            for (const std::size_t part : {size / 2, size - size / 2}) (part == half ? nextFewer : nextMore) += count;
        };
        halve(small, fewer);
        halve(small + 1, more);
        small = half;
        fewer = nextFewer;
        more = nextMore;
    }
    return nodes;
}

/// Builds the two children of a node, in parallel if it has many items.
template <class Left, class Right>
void buildChildren(std::size_t items, const Left& left, const Right& right) {
    if (items > medianTreeTask)
        tbb::parallel_invoke(left, right);
    else {
        left();
        right();
    }
}

}  // namespace bilayer::detail
