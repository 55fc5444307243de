// SPDX-License-Identifier: Apache-2.0
// Divides the space around the leaves of a narrow band into cubes. Each leaf is a cube. The space between leaves is
// divided into the largest octree cubes without a leaf. Sign methods traverse these cubes instead of voxels.
// Tested by tests/sdf/flood.cpp.
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "sdf/base/openvdb.h"
#include "sdf/leaf/band.h"

namespace bilayer::detail {

class Progress;

using BandLeaf = openvdb::FloatTree::LeafNodeType;

/// A cube of voxels: a leaf, or space without leaves.
struct OctreeCell {
    openvdb::Coord origin;  ///< index coordinates of the first voxel, multiples of `side` from the base of OctreeCells
    std::int32_t side;      ///< [voxels], 8 times a power of two
    BandLeaf* leaf;         ///< null: none
};

class OctreeCells {
  public:
    static constexpr std::int32_t brickSide = 64;  ///< [voxels]
    static constexpr std::size_t none = std::numeric_limits<std::size_t>::max();

    /// Divides a cube that contains the leaves (any order, at least one) and the box `space` [voxels].
    /// @param progress  polled for cancellation, unless null
    OctreeCells(std::vector<BandLeaf*> leaves, const openvdb::CoordBBox& space, Progress* progress = nullptr);

    std::span<const OctreeCell> all() const { return cells_; }
    /// Cells are grouped by brick: the cells of one aligned cube of 64 voxels, or one larger cell. Brick b is
    /// [bricks()[b], bricks()[b + 1]) of all().
    std::span<const std::size_t> bricks() const { return bricks_; }
    /// Returns the index of the cell that contains a voxel, or `none` beyond the cube.
    std::size_t find(const openvdb::Coord& voxel) const;

  private:
    void cut(std::span<BandLeaf* const> leaves, const openvdb::Coord& origin, std::int64_t side, Progress* progress);

    openvdb::Coord base_;
    std::int64_t side_;
    std::vector<OctreeCell> cells_;
    std::vector<std::size_t> bricks_;
};

/// Tolerance for the rounding of floats in sums of distances [voxels].
inline constexpr float distanceSlack = 1e-3f;

inline bool test(const BlockMask& mask, unsigned voxel) {
    return (mask[voxel / 64] >> (voxel % 64)) & 1;
}
inline void set(BlockMask& mask, unsigned voxel) {
    mask[voxel / 64] |= std::uint64_t(1) << (voxel % 64);
}

/// Moves the voxels of `mask` on one face (axis 0..2, side 0: lower, 1: upper) to the opposite face. There the
/// neighbour across that face has its adjacent voxels.
BlockMask across(const BlockMask& mask, int axis, int side);

/// Returns the voxels of a leaf whose distances are larger than `limit` [m].
BlockMask farther(const float* distances, float limit);

/// Signs an unsigned leaf. Voxels with -interior < distance < exterior are active; others hold +exterior or -interior.
void signLeaf(BandLeaf& leaf, const BlockMask& inside, const BandWidths& widths);

/// Returns the leaves of a grid; the grid keeps ownership.
std::vector<BandLeaf*> leavesOf(openvdb::FloatGrid& grid);

/// Converts a grid of signed leaves to a level set. The space between leaves gets the exterior width. The boxes
/// `inside`, which contain no leaf, get inactive tiles of minus the interior width. A leaf or node with one uniform
/// inactive value becomes a tile.
/// @param progress  polled for cancellation, unless null; if it throws, the grid has lost its leaves
void assemble(openvdb::FloatGrid& grid, const std::vector<openvdb::CoordBBox>& inside, const BandWidths& widths,
              Progress* progress = nullptr);
/// The same with the values of space [m].
void assemble(openvdb::FloatGrid& grid, const std::vector<openvdb::CoordBBox>& inside, float exterior, float interior,
              Progress* progress = nullptr);

}  // namespace bilayer::detail
