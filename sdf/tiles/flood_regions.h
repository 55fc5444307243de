// SPDX-License-Identifier: Apache-2.0
// The regions of a tile where the ball of a flood fits: sets of voxels that are connected within the tile. They are
// joined across the borders of all tiles, which shows which of them are outside.
// Tested by tests/sdf/tile_flood_signs.cpp.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <glm/vec3.hpp>
#include <limits>
#include <span>
#include <unordered_map>
#include <vector>

#include "sdf/leaf/band.h"
#include "sdf/leaf/blocks.h"
#include "sdf/mesh/topology.h"
#include "sdf/sign/octree_cells.h"
#include "sdf/tiles/flood_border.h"
#include "sdf/tiles/tiling.h"

namespace bilayer::detail {

class FloodRegions {
  public:
    static constexpr std::uint32_t noLeaf = std::numeric_limits<std::uint32_t>::max();

    /// @param leaves  of the tile, with unsigned distances; the order gives their numbers
    /// @param own     the tile's blocks, unbounded where no tile follows
    /// @param box     the same within the lattice of all tiles
    /// @param free    the distance of voxels where the ball fits [m]
    FloodRegions(std::span<BandLeaf* const> leaves, const BlockBox& own, const BlockBox& box, float free);

    const FloodBorder& border() const { return border_; }

    /// Returns whether a block that is no leaf is inside.
    /// @param sides  of the border's regions. Another region is outside if it reaches the space beyond all tiles.
    bool isInside(const glm::ivec3& block, const RegionSides& sides);

    /// Returns the voxels of a leaf where the ball fits. Adds those that are inside to `inside`.
    BlockMask freeVoxels(std::size_t leaf, const RegionSides& sides, BlockMask& inside);

    /// Returns the number of the leaf at a block of the tile, or noLeaf.
    std::uint32_t leafAt(const glm::ivec3& block) const { return leafAt_[numberOf(block)]; }
    const BlockBox& box() const { return box_; }

  private:
    struct LeafParts {
        std::uint32_t first;  // index of the first part's set
        std::vector<BlockMask> masks;
    };

    std::size_t numberOf(const glm::ivec3& block) const;
    template <class Visit>
    void forEachPart(const glm::ivec3& block, const BlockMask& within, const Visit& visit) const;
    void join(const glm::ivec3& block);
    std::uint32_t numberOfRegion(std::uint32_t set);
    bool isInside(std::uint32_t set, const RegionSides& sides);
    void makeBorder(std::span<BandLeaf* const> leaves);
    void addToBorder(const glm::ivec3& block, const BandLeaf* leaf);

    BlockBox own_, box_;
    glm::ivec3 size_;  // [blocks]
    std::vector<std::uint32_t> leafAt_;
    std::vector<LeafParts> parts_;
    DisjointSets sets_;
    std::unordered_map<std::uint32_t, std::uint32_t> regions_;  // of roots that touch the border
    FloodBorder border_;
};

/// Returns the sides of the regions of all tiles: outside is what is connected to the space beyond all tiles.
/// @param borderOf  called several times per tile
std::vector<RegionSides> joinRegions(const Tiling& tiling, const std::function<FloodBorder(std::size_t)>& borderOf);

}  // namespace bilayer::detail
