// SPDX-License-Identifier: Apache-2.0
// Highway compiles the code between HWY_BEFORE_NAMESPACE and HWY_AFTER_NAMESPACE once per instruction set.
#include "sdf/leaf/band.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "sdf/leaf/band.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <cstring>
#include <limits>

HWY_BEFORE_NAMESPACE();
namespace bilayer::detail::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;
namespace {

using Tag = hn::CappedTag<float, 2 * blockSide>;
using Mask = hn::Mask<Tag>;

inline void setBits(Mask mask, int voxel, BlockMask& bits) {
    std::uint8_t some[8] = {};
    hn::StoreMaskBits(Tag(), mask, some);
    std::uint64_t word;
    std::memcpy(&word, some, sizeof word);
    bits[std::size_t(voxel / 64)] |= word << (voxel % 64);
}

inline Mask getBits(const BlockMask& bits, int voxel) {
    const std::uint64_t word = bits[std::size_t(voxel / 64)] >> (voxel % 64);
    std::uint8_t some[8];
    std::memcpy(some, &word, sizeof some);
    return hn::LoadMaskBits(Tag(), some);
}

// Classifies each voxel by its distance: unknown, inside, in the band.
void sortVoxels(const float* distances, const BandWidths& widths, BlockMask& unknown, BlockMask& inside,
                BlockMask& band) {
    const Tag tag;
    const auto size = hn::Set(tag, widths.voxelSize),
               highest = hn::Set(tag, edgeOfBand(widths.exterior, widths.voxelSize)),
               lowest = hn::Set(tag, -edgeOfBand(widths.interior, widths.voxelSize));
    unknown = inside = band = {};
    for (int i = 0; i < blockVoxels; i += int(hn::Lanes(tag))) {
        const auto d = hn::LoadU(tag, distances + i);
        setBits(hn::Eq(d, hn::Set(tag, std::numeric_limits<float>::infinity())), i, unknown);
        setBits(hn::MaskFromVec(hn::BitCast(tag, hn::BroadcastSignBit(hn::BitCast(hn::RebindToSigned<Tag>(), d)))), i,
                inside);
        const auto metres = hn::Mul(d, size);
        setBits(hn::And(hn::Lt(metres, highest), hn::Gt(metres, lowest)), i, band);
    }
}

// Propagates the known signs into the unknown voxels, one step at a time. Outside wins a tie.
void flood(BlockMask& unknown, BlockMask& outside, BlockMask& inside) {
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

void writeValues(const float* distances, const BandWidths& widths, const BlockMask& inside, const BlockMask& band,
                 float* values) {
    const Tag tag;
    const auto size = hn::Set(tag, widths.voxelSize), exterior = hn::Set(tag, widths.exterior * widths.voxelSize),
               interior = hn::Set(tag, -widths.interior * widths.voxelSize);
    for (int i = 0; i < blockVoxels; i += int(hn::Lanes(tag))) {
        const auto far = hn::IfThenElse(getBits(inside, i), interior, exterior);
        const auto near = hn::Mul(hn::LoadU(tag, distances + i), size);
        hn::StoreU(hn::IfThenElse(getBits(band, i), near, far), tag, values + i);
    }
}

}  // namespace
}  // namespace bilayer::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bilayer::detail {
namespace {

HWY_EXPORT(flood);
HWY_EXPORT(sortVoxels);
HWY_EXPORT(writeValues);

}  // namespace

bool trimToBand(const float* distances, const BandWidths& widths, float* values, BandMasks& masks) {
    BlockMask unknown, inside, band;
    HWY_DYNAMIC_DISPATCH(sortVoxels)(distances, widths, unknown, inside, band);
    if (any(unknown)) {
        BlockMask outside;
        for (std::size_t x = 0; x < blockSide; ++x) outside[x] = ~(unknown[x] | inside[x]);
        const bool anyInside = any(inside), anyOutside = any(outside);
        if (!anyInside && !anyOutside) return false;
        if (anyInside && anyOutside)
            HWY_DYNAMIC_DISPATCH(flood)(unknown, outside, inside);
        else if (anyInside)
            inside.fill(~0ull);
    }
    masks = {band, inside};
    HWY_DYNAMIC_DISPATCH(writeValues)(distances, widths, inside, band, values);
    return true;
}

}  // namespace bilayer::detail
#endif  // HWY_ONCE
