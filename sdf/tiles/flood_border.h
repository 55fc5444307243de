// SPDX-License-Identifier: Apache-2.0
// What a flood in one tile passes to the tiles around it: the outermost voxels of the tile, the regions of free space
// that they belong to, and the steps in which the flood reaches the others.
//
// Tested by tests/sdf/tile_flood_signs.cpp.
#pragma once

#include <cstdint>
#include <filesystem>
#include <glm/vec3.hpp>
#include <optional>
#include <string>
#include <vector>

#include "sdf/leaf/band.h"
#include "sdf/leaf/blocks.h"

namespace bilayer::detail {

/// Whether each region of a tile is inside.
using RegionSides = std::vector<std::uint8_t>;

/// A leaf with voxels on the border of its tile.
struct BorderLeaf {
    struct Part {
        std::uint64_t region;  ///< 64 bits, so that files have no gaps
        BlockMask voxels;
    };
    glm::ivec3 first;
    std::vector<Part> parts;       ///< of the border's voxels where the flood's ball fits
    std::vector<float> distances;  ///< of the border's voxels, in their order in the leaf [m]
};

/// A row of blocks along z that are no leaves.
struct SpaceRow {
    glm::ivec3 first;
    std::int32_t blocks;
    std::uint32_t region;
};

/// The border of a tile towards other tiles. Regions are connected sets of the tile's voxels where the ball fits;
/// those that touch the border are numbered.
struct FloodBorder {
    BlockBox own;                    ///< the tile's blocks
    std::vector<std::uint8_t> open;  ///< whether each region reaches the space beyond all tiles, within its tile
    std::vector<SpaceRow> space;     ///< in the order of coordinates, as the leaves
    std::vector<BorderLeaf> leaves;
    bool isEmpty = false;  ///< the tile has no leaf: all of it is region 0

    /// Returns the region of a block of the border that is no leaf.
    std::optional<std::uint32_t> spaceAt(const glm::ivec3& block) const;
    /// Returns a leaf of the border; null if the block is none.
    const BorderLeaf* leafAt(const glm::ivec3& block) const;
};

/// Returns the border of a tile without leaves.
FloodBorder emptyBorder(const BlockBox& own);

/// Returns the voxels of a block that lie on those sides of its tile where other tiles follow.
BlockMask borderVoxels(const BlockBox& own, const glm::ivec3& block);

/// @param distancesHash  of the file of the tile's distances
void writeBorder(const std::filesystem::path& path, const FloodBorder& border, const std::string& distancesHash);
/// Throws std::runtime_error that names a file that is damaged.
FloodBorder readBorder(const std::filesystem::path& path, std::string* distancesHash = nullptr);

/// A voxel of a border where the ball does not fit, and the step in which the flood reaches it.
struct BorderArrival {
    glm::ivec3 leaf;
    std::uint32_t step;
    std::uint16_t voxel, inside;

    bool operator==(const BorderArrival&) const = default;
};

/// The arrivals at a border, and the round in which they were last improved.
struct BorderArrivals {
    std::uint32_t round = 0;
    std::vector<BorderArrival> all;
};

void writeArrivals(const std::filesystem::path& path, const BorderArrivals& arrivals);
/// Returns the round that a file states, without a check of its hash; 0 if there is no such file.
std::uint32_t readRound(const std::filesystem::path& path);
/// Throws std::runtime_error that names a file that is damaged.
BorderArrivals readArrivals(const std::filesystem::path& path);

}  // namespace bilayer::detail
