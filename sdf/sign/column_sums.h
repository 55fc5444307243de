// SPDX-License-Identifier: Apache-2.0
// Sums of the crossings of columns of voxels with triangles, for a rectangle of columns.
// Tested by tests/sdf/column_sums.cpp.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/common.hpp>
#include <glm/vec2.hpp>
#include <vector>

namespace bilayer::detail {

/// One sum per column of a rectangle, zero at first. A crossing into a solid counts +1, one out of it -1. For a closed
/// mesh, the sum of all crossings below a voxel is exactly its winding number.
class ColumnSums {
  public:
    /// @param first, end  columns, `end` without them [voxels]
    ColumnSums(const glm::ivec2& first, const glm::ivec2& end)
        : first_(first),
          end_(glm::max(first, end)),
          sums_(std::size_t(end_.x - first.x) * std::size_t(end_.y - first.y)) {}

    const glm::ivec2& first() const { return first_; }
    const glm::ivec2& end() const { return end_; }

    bool contains(int x, int y) const { return x >= first_.x && y >= first_.y && x < end_.x && y < end_.y; }
    /// The sum of a column; zero outside of the rectangle.
    std::int32_t at(int x, int y) const { return contains(x, y) ? sums_[place(x, y)] : 0; }
    void add(int x, int y, std::int32_t crossings) { sums_[place(x, y)] += crossings; }

    /// Adds the sums of the columns that both have.
    void add(const ColumnSums& other) {
        const glm::ivec2 low = glm::max(first_, other.first_), high = glm::min(end_, other.end_);
        for (int x = low.x; x < high.x; ++x)
            for (int y = low.y; y < high.y; ++y) sums_[place(x, y)] += other.sums_[other.place(x, y)];
    }

    std::vector<std::int32_t>& values() { return sums_; }  ///< by x, then by y
    const std::vector<std::int32_t>& values() const { return sums_; }

  private:
    std::size_t place(int x, int y) const {
        return std::size_t(x - first_.x) * std::size_t(end_.y - first_.y) + std::size_t(y - first_.y);
    }

    glm::ivec2 first_, end_;
    std::vector<std::int32_t> sums_;
};

}  // namespace bilayer::detail
