// SPDX-License-Identifier: Apache-2.0
// Converts the distances of a block to the values of a leaf: limited to the band, every voxel signed.
#pragma once

#include <array>
#include <cstdint>

#include "sdf/leaf/blocks.h"

namespace bilayer::detail {

/// One bit per voxel, in the order of an OpenVDB leaf: voxel (x, y, z) is bit y * 8 + z of word x.
using BlockMask = std::array<std::uint64_t, blockSide>;

inline bool any(const BlockMask& mask) {
    std::uint64_t bits = 0;
    for (const std::uint64_t word : mask) bits |= word;
    return bits != 0;
}

/// The voxels with the lowest z of their row, in a word of a mask.
inline constexpr std::uint64_t lowestZ = 0x0101010101010101ull;

/// Returns the mask dilated by the face neighbours inside the block.
inline BlockMask grown(const BlockMask& mask) {
    constexpr std::uint64_t highestZ = lowestZ << 7;
    BlockMask result;
    for (std::size_t x = 0; x < blockSide; ++x) {
        const std::uint64_t m = mask[x];
        result[x] = m | ((m & ~highestZ) << 1) | ((m & ~lowestZ) >> 1) | (m << 8) | (m >> 8);
    }
    for (std::size_t x = 1; x < blockSide; ++x) {
        result[x] |= mask[x - 1];
        result[x - 1] |= mask[x];
    }
    return result;
}

struct BandWidths {
    float exterior, interior;  ///< [voxels]
    float voxelSize;           ///< [m]
};

/// The voxels of a leaf that lie in the band, and those inside the surface.
struct BandMasks {
    BlockMask active, inside;
};

/// Voxels closer than this to the edge of the band are outside the band [voxels]. A face exactly one band width away
/// thus gives the same voxels with any rounding.
inline constexpr float bandEdge = 1e-5f;

/// Voxels of the band are closer to the surface than this [m]. Compared in metres, so that a distance is on the same
/// side of the edge before and after it is stored.
inline float edgeOfBand(float width, float voxelSize) {
    return width * voxelSize - bandEdge * voxelSize;
}

/// Converts the signed distances of a block [voxels] to the values of a leaf [m]. Voxels with -interior < distance <
/// exterior are active; others hold +exterior or -interior. Voxels of unknown distance take the sign of connected known
/// voxels in the block, the nearest first. Returns false and writes nothing if no distance is known.
bool trimToBand(const float* distances, const BandWidths& widths, float* values, BandMasks& masks);

}  // namespace bilayer::detail
