#include "sdf/band.h"

#include <bit>
#include <limits>

namespace bilayer {
namespace {

constexpr std::uint64_t lowestZ = 0x0101010101010101ull;  // the voxels with z = 0 of a slice
constexpr std::uint64_t highestZ = lowestZ << 7;

bool any(const BlockMask& mask) {
    std::uint64_t bits = 0;
    for (const std::uint64_t word : mask) bits |= word;
    return bits != 0;
}

// The mask and all voxels that share a face with it.
BlockMask grown(const BlockMask& mask) {
    BlockMask result;
    for (std::size_t x = 0; x < blockSide; ++x) {
        const std::uint64_t m = mask[x];
        result[x] = m | ((m & ~highestZ) << 1) | ((m & ~lowestZ) >> 1) | (m << 8) | (m >> 8);
        if (x > 0) result[x] |= mask[x - 1];
        if (x + 1 < blockSide) result[x] |= mask[x + 1];
    }
    return result;
}

// Lets the known signs grow into the unknown voxels, a step at a time; where both arrive at once the outside wins.
void flood(BlockMask unknown, BlockMask& outside, BlockMask& inside) {
    while (any(unknown)) {
        const BlockMask out = grown(outside), in = grown(inside);
        std::uint64_t changed = 0;
        for (std::size_t x = 0; x < blockSide; ++x) {
            const std::uint64_t newOut = out[x] & unknown[x], newIn = in[x] & unknown[x] & ~newOut;
            outside[x] |= newOut;
            inside[x] |= newIn;
            unknown[x] &= ~(newOut | newIn);
            changed |= newOut | newIn;
        }
        if (changed == 0) return;
    }
}

}  // namespace

bool trimToBand(const float* distances, const BandWidths& widths, float* values, BlockMask& active) {
    BlockMask unknown, inside, outside, band;
    for (std::size_t x = 0; x < blockSide; ++x) {
        std::uint64_t unknownBits = 0, insideBits = 0, bandBits = 0;
        for (unsigned i = 0; i < 64; ++i) {
            const float d = distances[x * 64 + i];
            unknownBits |= std::uint64_t(d == std::numeric_limits<float>::infinity()) << i;
            insideBits |= std::uint64_t(std::bit_cast<std::uint32_t>(d) >> 31) << i;
            bandBits |= std::uint64_t(int(d < widths.exterior) & int(d > -widths.interior)) << i;
        }
        unknown[x] = unknownBits;
        inside[x] = insideBits;
        outside[x] = ~(unknownBits | insideBits);
        band[x] = bandBits;
    }
    if (!any(inside) && !any(outside)) return false;
    if (any(unknown)) flood(unknown, outside, inside);
    active = band;
    const float exterior = widths.exterior * widths.voxelSize, interior = -widths.interior * widths.voxelSize;
    for (std::size_t x = 0; x < blockSide; ++x)
        for (unsigned i = 0; i < 64; ++i) {
            const float far = (inside[x] >> i) & 1 ? interior : exterior;
            values[x * 64 + i] = (band[x] >> i) & 1 ? distances[x * 64 + i] * widths.voxelSize : far;
        }
    return true;
}

}  // namespace bilayer
