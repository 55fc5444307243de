// SPDX-License-Identifier: Apache-2.0
#include "sdf/mesh/part_boxes.h"

#include <algorithm>
#include <limits>
#include <utility>

namespace bilayer::detail {
namespace {

constexpr std::size_t leafItems = 4;

float coordinate(const Bounds& box, int axis) {
    return axis < 3 ? box.lower[axis] : box.upper[axis - 3];
}

// Returns the coordinate of the boxes' corners that varies most.
int widestAxis(std::span<const RankedBox> items) {
    int widest = 0;
    float width = -1;
    for (int axis = 0; axis < 6; ++axis) {
        float low = std::numeric_limits<float>::infinity(), high = -low;
        for (const RankedBox& item : items) {
            low = std::min(low, coordinate(item.box, axis));
            high = std::max(high, coordinate(item.box, axis));
        }
        if (high - low > width) {
            width = high - low;
            widest = axis;
        }
    }
    return widest;
}

}  // namespace

PartBoxes::PartBoxes(std::vector<RankedBox> items) : items_(std::move(items)) {
    if (items_.empty()) return;
    const auto split = [&](std::size_t begin, std::size_t middle, std::size_t end) {
        const auto range = std::span(items_).subspan(begin, end - begin);
        std::nth_element(range.begin(), range.begin() + std::ptrdiff_t(middle - begin), range.end(),
                         [axis = widestAxis(range)](const RankedBox& a, const RankedBox& b) {
                             const float x = coordinate(a.box, axis), y = coordinate(b.box, axis);
                             return x != y ? x < y : a.rank < b.rank;
                         });
    };
    tree_.build(items_.size(), leafItems, split, [&](std::uint32_t node) { return groupOf(node); });
}

PartBoxes::Group PartBoxes::groupOf(std::uint32_t node) const {
    Group group;
    for (const RankedBox& item : std::span(items_).subspan(tree_[node].begin, tree_[node].end - tree_[node].begin)) {
        group.box.add(item.box.lower);
        group.box.add(item.box.upper);
        group.firstRank = std::min(group.firstRank, item.rank);
        group.lastRank = std::max(group.lastRank, item.rank);
    }
    return group;
}

}  // namespace bilayer::detail
