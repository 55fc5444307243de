// SPDX-License-Identifier: Apache-2.0
// Highway compiles the code between HWY_BEFORE_NAMESPACE and HWY_AFTER_NAMESPACE once per instruction set.
#include "sdf/leaf/sign_propagation.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "sdf/leaf/sign_propagation.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace bilayer::detail::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;
namespace {

// Returns the bits of the voxels in a row whose distance plus a neighbour's distance exceeds one voxel.
inline std::uint64_t linked(const float* a, const float* b) {
    const hn::CappedTag<float, blockSide> tag;
    std::uint64_t bits = 0;
    for (std::size_t z = 0; z < std::size_t(blockSide); z += hn::Lanes(tag)) {
        std::uint8_t some = 0;
        const auto sum = hn::Add(hn::LoadU(tag, a + z), hn::LoadU(tag, b + z));
        hn::StoreMaskBits(tag, hn::Gt(sum, hn::Set(tag, 1.f + linkSlack)), &some);
        bits |= std::uint64_t(some) << z;
    }
    return bits;
}

SignLinks linksOf(const float* distances) {
    constexpr std::uint64_t withoutLast = 0x7f;
    SignLinks links{};
    for (int x = 0; x < blockSide; ++x)
        for (int y = 0; y < blockSide; ++y) {
            const float* row = distances + (x * blockSide + y) * blockSide;
            links.z[std::size_t(x)] |= (linked(row, row + 1) & withoutLast) << (y * blockSide);
            if (y + 1 < blockSide) links.y[std::size_t(x)] |= linked(row, row + blockSide) << (y * blockSide);
            if (x + 1 < blockSide)
                links.x[std::size_t(x)] |= linked(row, row + blockSide * blockSide) << (y * blockSide);
        }
    return links;
}

}  // namespace
}  // namespace bilayer::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bilayer::detail {

HWY_EXPORT(linksOf);

namespace {

// Grows a set within one slice of 64 voxels until it is stable.
std::uint64_t grownInSlice(std::uint64_t set, std::uint64_t linkY, std::uint64_t linkZ) {
    for (;;) {
        const std::uint64_t old = set;
        set |= ((set & linkZ) << 1) | ((set >> 1) & linkZ);
        set |= ((set & linkY) << 8) | ((set >> 8) & linkY);
        if (set == old) return set;
    }
}

}  // namespace

SignLinks findSignLinks(const float* distances) {
    return HWY_DYNAMIC_DISPATCH(linksOf)(distances);
}

void propagate(const SignLinks& links, BlockMask& set) {
    unsigned changed = 0;  // slices whose neighbours still need an update
    for (std::size_t x = 0; x < set.size(); ++x) {
        if (set[x] == 0) continue;
        set[x] = grownInSlice(set[x], links.y[x], links.z[x]);
        changed |= 1u << x;
    }
    while (changed != 0) {
        const auto x = std::size_t(std::countr_zero(changed));
        changed &= changed - 1;
        const auto give = [&](std::size_t to, std::uint64_t voxels) {
            if ((voxels & ~set[to]) == 0) return;
            set[to] = grownInSlice(set[to] | voxels, links.y[to], links.z[to]);
            changed |= 1u << to;
        };
        if (x + 1 < set.size()) give(x + 1, set[x] & links.x[x]);
        if (x > 0) give(x - 1, set[x] & links.x[x - 1]);
    }
}

}  // namespace bilayer::detail
#endif  // HWY_ONCE
