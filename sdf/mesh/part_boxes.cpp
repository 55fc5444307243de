// SPDX-License-Identifier: Apache-2.0
#include "sdf/mesh/part_boxes.h"

#include <algorithm>
#include <limits>
#include <utility>

namespace bilayer::detail {
namespace {

constexpr std::uint32_t leafItems = 4;

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
    if (!items_.empty()) build(0, std::uint32_t(items_.size()));
}

void PartBoxes::build(std::uint32_t begin, std::uint32_t end) {
    const std::size_t at = nodes_.size();
    nodes_.push_back({{}, ~0u, 0, begin, end, 0});
    const std::span range = std::span(items_).subspan(begin, end - begin);
    for (const RankedBox& item : range) {
        Node& node = nodes_[at];
        node.box.add(item.box.lower);
        node.box.add(item.box.upper);
        node.firstRank = std::min(node.firstRank, item.rank);
        node.lastRank = std::max(node.lastRank, item.rank);
    }
    if (range.size() <= leafItems) return;
    const int axis = widestAxis(range);
    const std::uint32_t middle = begin + (end - begin) / 2;
    std::nth_element(range.begin(), range.begin() + (middle - begin), range.end(),
                     [axis](const RankedBox& a, const RankedBox& b) {
                         const float x = coordinate(a.box, axis), y = coordinate(b.box, axis);
                         return x != y ? x < y : a.rank < b.rank;
                     });
    build(begin, middle);
    nodes_[at].right = std::uint32_t(nodes_.size());
    build(middle, end);
}

}  // namespace bilayer::detail
