// SPDX-License-Identifier: Apache-2.0
// A counting sort of the items in a brick by spatial cell.
// Tested by tests/sdf/exact.cpp.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <utility>
#include <vector>

namespace bilayer::detail {

/// A grid of cells over a box [voxels].
struct Cells {
    glm::vec3 lower;  ///< minimum corner of the box
    float side;       ///< of a cell
    glm::ivec3 size;  ///< count of cells along each axis

    Cells(const glm::vec3& lower, const glm::vec3& upper, float side)
        : lower(lower), side(side), size(glm::ivec3((upper - lower) / side) + 1) {}
    double count() const { return double(size.x) * double(size.y) * double(size.z); }
    std::uint32_t at(const glm::vec3& place) const {
        const glm::ivec3 cell((place - lower) / side);
        return std::uint32_t((cell.x * size.y + cell.y) * size.z + cell.z);
    }
};

/// Sorts items by cell. Reuses its memory for each brick.
template <class Item>
class CellSort {
  public:
    /// Sorts stably by the cell that contains place(item). Then calls visit(begin, end) for the items of each nonempty
    /// cell, in ascending order. `visit` may reorder those items.
    template <class Place, class Visit>
    void run(std::vector<Item>& items, const Cells& cells, Place place, Visit visit) {
        cellOf_.resize(items.size());
        ends_.assign(std::size_t(cells.count()), 0);
        for (std::size_t i = 0; i < items.size(); ++i) ++ends_[cellOf_[i] = cells.at(place(items[i]))];
        std::uint32_t sum = 0;
        for (std::uint32_t& end : ends_) sum += std::exchange(end, sum);
        unsorted_.swap(items);
        items.resize(unsorted_.size());
        for (std::size_t i = 0; i < unsorted_.size(); ++i) items[ends_[cellOf_[i]]++] = unsorted_[i];
        // Each cursor has reached the end of its cell.
        std::uint32_t begin = 0;
        for (const std::uint32_t end : ends_)
            if (end > begin) visit(std::exchange(begin, end), end);
    }

  private:
    std::vector<Item> unsorted_;
    std::vector<std::uint32_t> cellOf_, ends_;
};

}  // namespace bilayer::detail
