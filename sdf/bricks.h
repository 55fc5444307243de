// Which tiles reach which 8x8x8 block. Blocks are grouped into bricks of 8x8x8 blocks: tiles are binned into bricks
// first and, brick by brick, into blocks, so that only small counters are needed and a brick's work stays in cache.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "sdf/tiles.h"

namespace bilayer {

inline constexpr int brickBlocks = 8;  ///< blocks along the side of a brick
inline constexpr int brickSide = 64;   ///< voxels along the side of a brick

/// The bricks that some tile reaches, each with its tiles in ascending order.
struct Bricks {
    std::vector<glm::ivec3> origins;     ///< index coordinates of each brick's first voxel, multiples of brickSide
    std::vector<std::uint64_t> offsets;  ///< tiles of brick b: tiles[offsets[b]] .. tiles[offsets[b + 1]]
    std::vector<std::uint32_t> tiles;    ///< indices into Tiles::tiles

    std::size_t count() const { return origins.size(); }
    std::span<const std::uint32_t> tilesOf(std::size_t brick) const {
        return {tiles.data() + offsets[brick], tiles.data() + offsets[brick + 1]};
    }
};

/// The blocks of one brick that some tile reaches, each with its tiles in ascending order.
struct BrickBlocks {
    std::vector<glm::ivec3> origins;     ///< index coordinates of each block's first voxel, multiples of 8
    std::vector<std::uint32_t> offsets;  ///< as Bricks::offsets
    std::vector<std::uint32_t> tiles;    ///< indices into Tiles::tiles

    struct Pair {
        std::uint32_t block, tile;
    };
    std::vector<Pair> pairs;  ///< scratch of binBlocks()
};

/// Bins tiles into bricks. `reach` is how far from a sample a voxel may lie [voxels].
Bricks binBricks(const Tiles& tiles, float reach);

/// Bins the tiles of one brick into its blocks. `blocks` is overwritten; its memory is used again.
void binBlocks(const Tiles& tiles, const Bricks& bricks, std::size_t brick, float reach, BrickBlocks& blocks);

}  // namespace bilayer
