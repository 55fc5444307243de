#include "sdf/links.h"

#include <bit>

namespace bilayer {
namespace {

// Lets a set grow inside one slice of 64 voxels until it stops.
std::uint64_t grownInSlice(std::uint64_t set, std::uint64_t linkY, std::uint64_t linkZ) {
    for (;;) {
        const std::uint64_t old = set;
        set |= ((set & linkZ) << 1) | ((set >> 1) & linkZ);
        set |= ((set & linkY) << 8) | ((set >> 8) & linkY);
        if (set == old) return set;
    }
}

}  // namespace

void spread(const Links& links, BlockMask& set) {
    unsigned changed = 0;  // slices whose neighbours have not heard of them yet
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

}  // namespace bilayer
