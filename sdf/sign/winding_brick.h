// SPDX-License-Identifier: Apache-2.0
// The cells of one brick of OctreeCells, found by voxel. One task signs a brick by winding numbers.
// Tested by tests/sdf/winding.cpp through build().
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "sdf/sign/octree_cells.h"

namespace bilayer::detail {

/// The cells of a brick. Those without leaves, the empty cells, are numbered in their order.
class WindingBrick {
  public:
    explicit WindingBrick(std::span<const OctreeCell> cells);

    std::span<const OctreeCell> cells() const { return cells_; }

    /// Returns the number of the empty cell that contains a voxel; negative if none does.
    int emptyAt(const openvdb::Coord& voxel) const { return contains(voxel) ? numberAt(voxel) : -1; }

  private:
    bool contains(const openvdb::Coord& voxel) const {
        return openvdb::CoordBBox::createCube(origin_, OctreeCells::brickSide).isInside(voxel);
    }
    int numberAt(const openvdb::Coord& voxel) const {
        const openvdb::Coord o = voxel - origin_;
        return numbers_[std::size_t(((o.x() / 8) * 8 + o.y() / 8) * 8 + o.z() / 8)];
    }

    std::span<const OctreeCell> cells_;
    openvdb::Coord origin_;
    std::array<std::int16_t, blockVoxels> numbers_{};  // per block: of its empty cell; -1: a leaf
};

}  // namespace bilayer::detail
