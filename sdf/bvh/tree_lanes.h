// SPDX-License-Identifier: Apache-2.0
// SIMD lanes over a group or a leaf of a tree: one box or triangle per lane. Highway includes this file once for each
// instruction set: only between HWY_BEFORE_NAMESPACE's headers and its own, after hwy/highway.h.
// Tested by tests/sdf/wide_tree.cpp.
#if defined(BILAYER_SDF_TREE_LANES_H) == defined(HWY_TARGET_TOGGLE)
#ifdef BILAYER_SDF_TREE_LANES_H
#undef BILAYER_SDF_TREE_LANES_H
#else
#define BILAYER_SDF_TREE_LANES_H
#endif

#include <hwy/highway.h>

#include <cstdint>

#include "sdf/base/vector_lanes.h"
#include "sdf/bvh/box_tree.h"

HWY_BEFORE_NAMESPACE();
namespace bilayer::detail::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Tag = hn::CappedTag<float, treeWidth>;
using Vec = hn::Vec<Tag>;
using Mask = hn::Mask<Tag>;

inline unsigned bitsOf(Mask mask) {
    std::uint8_t bits[8] = {};
    hn::StoreMaskBits(Tag(), mask, bits);
    return bits[0];
}

/// Points, one per lane.
using PointLanes = VectorLanes<Tag>;

}  // namespace bilayer::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
