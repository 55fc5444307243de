// The space around the leaves of a narrow band, cut into cubes: each leaf is one, and what lies between them is cut
// into the largest cubes of an octree that hold no leaf. Methods that find signs walk over these instead of over
// voxels.
#pragma once

#include <openvdb/openvdb.h>

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "sdf/leaf/band.h"

namespace bilayer::detail {

class Progress;

using BandLeaf = openvdb::FloatTree::LeafNodeType;

/// A cube of voxels: a leaf, or space without leaves.
struct OctreeCell {
    openvdb::Coord
        origin;         ///< index coordinates of the first voxel, multiples of `side`, counted from OctreeCells::base()
    std::int32_t side;  ///< [voxels], 8 times a power of two
    BandLeaf* leaf;     ///< null: none
};

class OctreeCells {
  public:
    static constexpr std::size_t none = std::numeric_limits<std::size_t>::max();

    /// Cuts up a cube that holds the leaves (any order, at least one) and the box `space` [voxels].
    /// @param progress  polled, unless null
    OctreeCells(std::vector<BandLeaf*> leaves, const openvdb::CoordBBox& space, Progress* progress = nullptr);

    std::span<const OctreeCell> all() const { return cells_; }
    /// OctreeCells come brick by brick: those of one aligned cube of 64 voxels, or one larger cell. Brick b is
    /// [bricks()[b], bricks()[b + 1]) of all().
    std::span<const std::size_t> bricks() const { return bricks_; }
    /// The index of the cell that holds a voxel, or none beyond the cube.
    std::size_t find(const openvdb::Coord& voxel) const;

  private:
    void cut(std::span<BandLeaf* const> leaves, const openvdb::Coord& origin, std::int64_t side, Progress* progress);

    openvdb::Coord base_;
    std::int64_t side_;
    std::vector<OctreeCell> cells_;
    std::vector<std::size_t> bricks_;
};

inline bool test(const BlockMask& mask, unsigned voxel) {
    return (mask[voxel / 64] >> (voxel % 64)) & 1;
}
inline void set(BlockMask& mask, unsigned voxel) {
    mask[voxel / 64] |= std::uint64_t(1) << (voxel % 64);
}

/// The voxels of `mask` on a face (axis 0..2, side 0: lower, 1: upper), moved to the opposite face: where the neighbour
/// across that face has its voxels next to them.
BlockMask across(const BlockMask& mask, int axis, int side);

/// The voxels of a leaf farther from the surface than `limit` [m].
BlockMask farther(const BandLeaf& leaf, float limit);

/// Gives an unsigned leaf its signs: active where -interior < distance < exterior, else plus the exterior or minus the
/// interior width.
void signLeaf(BandLeaf& leaf, const BlockMask& inside, const BandWidths& widths);

/// The leaves of a grid, which go on being its own.
std::vector<BandLeaf*> leavesOf(openvdb::FloatGrid& grid);

/// Makes a grid of signed leaves a level set: plus the exterior width between them, and inactive tiles of minus the
/// interior width in the boxes `inside`, which hold no leaf; whatever holds one inactive value becomes a tile.
/// @param progress  polled, unless null; where it throws, the grid has lost its leaves
void assemble(openvdb::FloatGrid& grid, const std::vector<openvdb::CoordBBox>& inside, const BandWidths& widths,
              Progress* progress = nullptr);

}  // namespace bilayer::detail
