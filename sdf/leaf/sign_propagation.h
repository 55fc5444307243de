// Which voxels of a block must lie on the same side of the surface. The ball around a voxel with its distance as radius
// is free of surface; where the balls of two neighbours overlap (d1 + d2 > 1 voxel), so is the way between them: they
// are linked. A side found for one voxel then holds for all that links connect with it.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <initializer_list>

#include "sdf/leaf/band.h"

namespace bilayer::detail {

/// Slack of the test for a link, far above the rounding of distances [voxels].
inline constexpr float linkSlack = 1e-4f;

/// SignLinks inside a block. Bit of voxel v: v is linked with its next neighbour along the axis.
struct SignLinks {
    BlockMask x, y, z;
};

/// Finds the links of a block by the distances of its voxels to the surface; those beyond some reach of a voxel or more
/// may have any distance from there on.
/// @param distances  blockVoxels of them, and a row more that may be read [voxels]
SignLinks findSignLinks(const float* distances);

/// Adds to a set all voxels that links connect with it.
void spread(const SignLinks& links, BlockMask& set);

/// The voxels of a block on either side of the surface. One on both shows a contradiction.
struct BlockSides {
    BlockMask outside, inside;
};

/// Voxels farther from the surface than this are asked first for their side, then those beyond the next [voxels].
inline constexpr float farFrom = 0.5f, midFrom = 0.1f;

/// Spreads what sides are known over links. Of each group of linked voxels that this leaves without a side, one voxel
/// is asked for by isInside(voxel): one of the first of the `seeds` that hold any. Returns the number of voxels that
/// came to be on both sides; there are none of them if all the sides that were known are right.
template <class IsInside>
std::size_t completeSides(const SignLinks& links, std::initializer_list<const BlockMask*> seeds, BlockSides& sides,
                          IsInside isInside) {
    spread(links, sides.outside);
    spread(links, sides.inside);
    std::size_t onBoth = 0;
    for (std::size_t x = 0; x < sides.inside.size(); ++x)
        onBoth += std::size_t(std::popcount(sides.outside[x] & sides.inside[x]));
    for (const BlockMask* some : seeds)
        for (std::size_t x = 0; x < some->size(); ++x)
            while (const std::uint64_t open = (*some)[x] & ~(sides.outside[x] | sides.inside[x])) {
                const int voxel = int(x) * 64 + std::countr_zero(open);
                BlockMask& side = isInside(voxel) ? sides.inside : sides.outside;
                side[x] |= std::uint64_t(1) << (voxel % 64);
                spread(links, side);
            }
    return onBoth;
}

}  // namespace bilayer::detail
