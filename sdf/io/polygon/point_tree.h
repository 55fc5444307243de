// SPDX-License-Identifier: Apache-2.0
// A set of points in the plane with search by region; internal.
// Tested by tests/sdf/triangulate.cpp through triangulate().
#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <glm/common.hpp>
#include <glm/vec2.hpp>
#include <limits>
#include <numeric>
#include <span>
#include <vector>

namespace bilayer::detail {

/// An axis-aligned rectangle; empty by default.
struct Box2 {
    glm::dvec2 lower{std::numeric_limits<double>::infinity()};
    glm::dvec2 upper{-std::numeric_limits<double>::infinity()};

    bool operator==(const Box2&) const = default;
    void add(const Box2& other) {
        lower = glm::min(lower, other.lower);
        upper = glm::max(upper, other.upper);
    }
    bool meets(const Box2& other) const {
        return lower.x <= other.upper.x && other.lower.x <= upper.x && lower.y <= other.upper.y &&
               other.lower.y <= upper.y;
    }
};

/// A subset of given points, for searches by region. It is a balanced binary tree of bounding boxes, in which nearby
/// points share nodes.
class PointTree {
  public:
    /// Takes all points and marks none as present.
    void reset(std::span<const glm::dvec2> points) {
        leaves_ = std::bit_ceil(points.size());
        boxes_.assign(2 * leaves_, Box2{});
        items_.resize(points.size());
        std::iota(items_.begin(), items_.end(), 0u);
        if (points.size() > fewPoints) sort(points, 0, leaves_);
        places_.resize(points.size());
        for (unsigned place = 0; place < items_.size(); ++place) places_[items_[place]] = place;
    }

    void add(std::size_t item, const glm::dvec2& point) { put(item, {point, point}); }
    void remove(std::size_t item) { put(item, {}); }

    /// Returns whether `found(item)` holds for any present point, among those in boxes for which `reaches(box)` holds.
    template <typename Reaches, typename Found>
    bool any(const Reaches& reaches, const Found& found) const {
        return anyBelow(1, reaches, found);
    }

  private:
    static constexpr std::size_t fewPoints = 16;  ///< below this, sorting does not pay off

    // Recursively halves a range of slots along the longer side of the bounding box of its points.
    void sort(std::span<const glm::dvec2> points, std::size_t begin, std::size_t size) {
        const std::size_t end = std::min(begin + size, items_.size());
        if (size <= 4) return;
        if (begin + size / 2 >= end) return sort(points, begin, size / 2);
        Box2 box;
        for (std::size_t i = begin; i < end; ++i) box.add({points[items_[i]], points[items_[i]]});
        const glm::dvec2 extent = box.upper - box.lower;
        const int axis = extent.x >= extent.y ? 0 : 1;
        const auto at = [&](std::size_t i) { return items_.begin() + std::ptrdiff_t(i); };
        std::nth_element(at(begin), at(begin + size / 2), at(end),
                         [&](unsigned i, unsigned j) { return points[i][axis] < points[j][axis]; });
        sort(points, begin, size / 2);
        sort(points, begin + size / 2, size / 2);
    }

    void put(std::size_t item, const Box2& box) {
        std::size_t node = leaves_ + places_[item];
        boxes_[node] = box;
        while (node /= 2) {
            Box2 both = boxes_[2 * node];
            both.add(boxes_[2 * node + 1]);
            if (boxes_[node] == both) return;
            boxes_[node] = both;
        }
    }

    template <typename Reaches, typename Found>
    bool anyBelow(std::size_t node, const Reaches& reaches, const Found& found) const {
        if (!reaches(boxes_[node])) return false;
        if (node >= leaves_) return found(items_[node - leaves_]);
        return anyBelow(2 * node, reaches, found) || anyBelow(2 * node + 1, reaches, found);
    }

    std::size_t leaves_ = 1;
    std::vector<Box2> boxes_;       ///< box of node i contains those of nodes 2 i and 2 i + 1; slots begin at `leaves_`
    std::vector<unsigned> items_;   ///< the point of each slot
    std::vector<unsigned> places_;  ///< the slot of each point
};

}  // namespace bilayer::detail
