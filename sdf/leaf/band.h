// From the distances that a filler found to what a leaf of the band holds: trimmed to the band, every voxel signed.
#pragma once

#include <array>
#include <cstdint>

#include "sdf/leaf/blocks.h"

namespace bilayer::detail {

/// One bit a voxel, in the order of an OpenVDB leaf: voxel (x, y, z) is bit y * 8 + z of word x.
using BlockMask = std::array<std::uint64_t, blockSide>;

inline bool any(const BlockMask& mask) {
    std::uint64_t bits = 0;
    for (const std::uint64_t word : mask) bits |= word;
    return bits != 0;
}

/// The mask and all voxels that share a face with it inside the block.
inline BlockMask grown(const BlockMask& mask) {
    constexpr std::uint64_t lowestZ = 0x0101010101010101ull, highestZ = lowestZ << 7;  // of a word's rows
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

/// Which voxels of a leaf lie in the band, and which inside the surface.
struct BandMasks {
    BlockMask active, inside;
};

/// Nearer to the edge of the band than this is outside of it, so that a face of the mesh exactly as far away as the
/// band is wide gives the same voxels whatever the rounding [voxels].
inline constexpr float bandEdge = 1e-5f;

/// Turns one block's signed distances [voxels] into a leaf's values [m]: active where -interior < distance < exterior,
/// else plus the exterior or minus the interior width. Voxels of unknown distance take the sign of the known ones that
/// they are connected with inside the block, the nearest first. Returns false, and leaves the outputs alone, if nothing
/// is known.
bool trimToBand(const float* distances, const BandWidths& widths, float* values, BandMasks& masks);

}  // namespace bilayer::detail
