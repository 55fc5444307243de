// SPDX-License-Identifier: Apache-2.0
// A coarse distance bound for places far from a field's surface.
// Tested by tests/collider/field_rays.cpp through Field::raycast().
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

namespace bilayer::detail {

/// Fast conservative tests for places far from the surface. It is a view of a field's coarse cells, which take little
/// memory. A coarse cell has 4^3 voxels. Coordinates are in coarse cells from the field's origin.
class Clearance {
  public:
    static constexpr int cellSide = 4;  ///< [voxels]
    static constexpr int perBlock = 2;  ///< coarse cells along a block
    static constexpr int blockCells = perBlock * perBlock * perBlock;
    static constexpr int steps = 8;               ///< per edge of a coarse cell: the unit of stored distances
    static constexpr int maxDistanceSteps = 127;  ///< stored distances are clamped to this [steps]

    /// The arrays, ordered by block. The eight coarse cells of a block are contiguous, the last axis fastest.
    struct Data {
        const std::int32_t* directory;  ///< of FieldLayout
        const std::int8_t* centres;  ///< min distance from each cell's centre to the surface, negative inside [steps]
        const std::int8_t* minima;   ///< lower bound of the samples in each cell, by stored block [minimaStep]
        float minimaStep;            ///< [m]
        float ofEmptyBlocks[2];      ///< the same for cells of empty blocks, outside and inside [m]
        glm::ivec3 blocks;           ///< count along each axis
    };

    explicit Clearance(const Data& data)
        : data_(data), size_(perBlock * data.blocks), extent_(perBlock * data.blocks) {}

    /// A lower bound of the distance to the surface; not positive where it is unknown [coarse cells].
    float around(const glm::dvec3& point) const noexcept {
        const glm::ivec3 cell = cellOf(point);
        return std::abs(centreOf(cell)) - float(glm::distance(point, glm::dvec3(cell) + 0.5));
    }

    /// Whether a sphere certainly lies outside the surface. False for a non-finite centre.
    bool isOutside(const glm::vec3& centre, float radius) const noexcept {
        const glm::vec3 toBox = centre - clamped(centre);
        if (glm::dot(toBox, toBox) > radius * radius) return true;
        const glm::ivec3 cell = cellOf(centre);
        const glm::vec3 offset = centre - (glm::vec3(cell) + 0.5f);
        const float left = centreOf(cell) - radius;
        return left > 0 && glm::dot(offset, offset) < left * left;
    }

    /// Whether a sample there is certainly above `reach` [m], or outside the band.
    bool isAbove(const glm::vec3& point, float reach) const noexcept {
        const glm::ivec3 cell = cellOf(point);
        const std::int32_t block = data_.directory[entryOf(cell)];
        if (block < 0) return data_.ofEmptyBlocks[-1 - block] > reach;
        return float(data_.minima[std::size_t(block) * blockCells + inBlock(cell)]) * data_.minimaStep > reach;
    }

  private:
    // maps NaN to 0
    template <class Point>
    Point clamped(const Point& p) const noexcept {
        using Real = typename Point::value_type;
        return {std::min(std::max(Real(0), p.x), Real(extent_.x)), std::min(std::max(Real(0), p.y), Real(extent_.y)),
                std::min(std::max(Real(0), p.z), Real(extent_.z))};
    }
    template <class Point>
    glm::ivec3 cellOf(const Point& point) const noexcept {
        return glm::min(glm::ivec3(clamped(point)), size_ - 1);
    }
    std::size_t entryOf(const glm::ivec3& cell) const noexcept {
        const glm::ivec3 block = cell >> 1;
        return (std::size_t(block.x) * data_.blocks.y + block.y) * data_.blocks.z + block.z;
    }
    static std::size_t inBlock(const glm::ivec3& cell) noexcept {
        return std::size_t((cell.x & 1) << 2 | (cell.y & 1) << 1 | (cell.z & 1));
    }
    float centreOf(const glm::ivec3& cell) const noexcept {
        return float(data_.centres[entryOf(cell) * blockCells + inBlock(cell)]) * (1.f / steps);
    }

    Data data_;
    glm::ivec3 size_;
    glm::vec3 extent_;
};

}  // namespace bilayer::detail
