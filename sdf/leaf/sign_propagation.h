// SPDX-License-Identifier: Apache-2.0
// Finds the voxels of a block that must lie on the same side of the surface. The ball around a voxel with its distance
// as radius contains no surface. Where the balls of two neighbours overlap (d1 + d2 > 1 voxel), the segment between
// them crosses no surface, and the two are linked. The sign of one voxel then holds for all voxels that links connect
// to it.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <initializer_list>

#include "sdf/leaf/band.h"

namespace bilayer::detail {

/// Tolerance of the link test, far above the rounding of distances [voxels].
inline constexpr float linkSlack = 1e-4f;

/// Distances d that differ by less than this may be equal [voxels]: floats round the heights above two faces by as
/// much, at any height. Squared distances then differ by less than distanceTie * (1 + d^2), since 2 d <= 1 + d^2.
inline constexpr float distanceTie = 1e-5f;
/// A voxel that is closer to the plane of a face than this gets no side from the face's normal alone [voxels].
inline constexpr float minFaceHeight = 1e-3f;

/// The links inside a block. The bit of voxel v is set if v is linked to its next neighbour along the axis.
struct SignLinks {
    BlockMask x, y, z;
};

/// Finds the links of a block from the distances of its voxels to the surface. Distances beyond some reach of at least
/// one voxel may have any value that is not below it.
/// @param distances  blockVoxels values, plus one row that may be read [voxels]
SignLinks findSignLinks(const float* distances);

/// Adds to a set all voxels that links connect to it.
void propagate(const SignLinks& links, BlockMask& set);

/// Sets of voxels on each side of the surface. A voxel in both sets is a contradiction.
struct BlockSides {
    BlockMask outside, inside;
};

/// Voxels farther from the surface than farFrom are queried first, then those beyond midFrom [voxels].
inline constexpr float farFrom = 0.5f, midFrom = 0.1f;

/// Propagates known signs over links. For each linked group without a sign, queries isInside(voxel) for one of its
/// voxels. That voxel comes from the first of the `seeds` that contains any. Returns the count of voxels that ended on
/// both sides, which is zero if all known signs are right.
template <class IsInside>
std::size_t completeSides(const SignLinks& links, std::initializer_list<const BlockMask*> seeds, BlockSides& sides,
                          IsInside isInside) {
    propagate(links, sides.outside);
    propagate(links, sides.inside);
    std::size_t onBoth = 0;
    for (std::size_t x = 0; x < sides.inside.size(); ++x)
        onBoth += std::size_t(std::popcount(sides.outside[x] & sides.inside[x]));
    for (const BlockMask* some : seeds)
        for (std::size_t x = 0; x < some->size(); ++x)
            while (const std::uint64_t open = (*some)[x] & ~(sides.outside[x] | sides.inside[x])) {
                const int voxel = int(x) * 64 + std::countr_zero(open);
                BlockMask& side = isInside(voxel) ? sides.inside : sides.outside;
                side[x] |= std::uint64_t(1) << (voxel % 64);
                propagate(links, side);
            }
    return onBoth;
}

}  // namespace bilayer::detail
