// SPDX-License-Identifier: Apache-2.0
// SIMD narrowing of a list of nodes to those near a box of voxels. Highway includes this file once for each instruction
// set: only between HWY_BEFORE_NAMESPACE's headers and its own, after hwy/highway.h.
// Tested by tests/sdf/wide_tree.cpp through collectNodes().
#if defined(BILAYER_SDF_NODE_NARROWING_H) == defined(HWY_TARGET_TOGGLE)
#ifdef BILAYER_SDF_NODE_NARROWING_H
#undef BILAYER_SDF_NODE_NARROWING_H
#else
#define BILAYER_SDF_NODE_NARROWING_H
#endif

#include <hwy/highway.h>

#include <bit>
#include <cstddef>
#include <cstdint>

#include "sdf/base/compress.h"
#include "sdf/bvh/leaf_measure.h"
#include "sdf/bvh/node_list.h"

HWY_BEFORE_NAMESPACE();
namespace bilayer::detail::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;
namespace {

// Returns the squared distances of up to a vector of boxes from a box of voxels.
inline Vec boxDistance2(const float* const lower[3], const float* const upper[3], std::size_t i,
                        const VoxelBox& voxels) {
    const Tag tag;
    Vec sum = hn::Zero(tag);
    for (int k = 0; k < 3; ++k) {
        const Vec gap = hn::Max(hn::Sub(hn::LoadU(tag, lower[k] + i), hn::Set(tag, voxels.upper[k])),
                                hn::Sub(hn::Set(tag, voxels.lower[k]), hn::LoadU(tag, upper[k] + i)));
        sum = hn::Add(sum, square(hn::Max(gap, hn::Zero(tag))));
    }
    return sum;
}

// References to boxes in a list or in a group.
struct BoxArrays {
    const float *lower[3], *upper[3];

    explicit BoxArrays(const NodeList& list) {
        for (int k = 0; k < 3; ++k) lower[k] = list.lower[k].data(), upper[k] = list.upper[k].data();
    }
    explicit BoxArrays(const BoxGroup& group) {
        for (int k = 0; k < 3; ++k) lower[k] = group.lower[k], upper[k] = group.upper[k];
    }
};

// Appends the nodes near a box of voxels to a list.
struct Narrowing {
    const WideTree& tree;
    const VoxelBox& voxels;
    float reach2, largest;
    NodeList& to;

    using IndexTag = hn::RebindToUnsigned<Tag>;
    using NumberTag = hn::RebindToSigned<Tag>;

    void take(const BoxArrays& boxes, std::size_t i, hn::Vec<IndexTag> nodes, Mask valid) {
        const Tag tag;
        Vec side = hn::Zero(tag);
        for (int k = 0; k < 3; ++k)
            side = hn::Max(side, hn::Sub(hn::LoadU(tag, boxes.upper[k] + i), hn::LoadU(tag, boxes.lower[k] + i)));
        const Mask near =
            hn::And(valid, hn::Le(boxDistance2(boxes.lower, boxes.upper, i, voxels), hn::Set(tag, reach2)));
        const Mask isGroup = hn::RebindMask(
            tag, hn::Gt(hn::BitCast(NumberTag(), nodes), hn::Set(NumberTag(), std::int32_t(tree.leafCount) - 1)));
        const Mask open = hn::And(near, hn::And(isGroup, hn::Gt(side, hn::Set(tag, largest))));
        keep(boxes, i, nodes, hn::AndNot(open, near));
        HWY_ALIGN std::uint32_t numbers[treeWidth];
        hn::Store(nodes, IndexTag(), numbers);
        for (unsigned bits = bitsOf(open); bits != 0; bits &= bits - 1)
            takeGroup(tree.group(numbers[std::countr_zero(bits)]));
    }

    void takeGroup(const BoxGroup& group) {
        const BoxArrays boxes(group);
        for (std::size_t i = 0; i < treeWidth; i += hn::Lanes(Tag()))
            take(boxes, i, hn::Iota(IndexTag(), group.firstChild + std::uint32_t(i)), hn::FirstN(Tag(), treeWidth));
    }

    void keep(const BoxArrays& boxes, std::size_t i, hn::Vec<IndexTag> nodes, Mask mask) {
        const Tag tag;
        to.makeRoom(treeWidth);
        const Compressor<Tag> kept(tag, mask);
        for (int k = 0; k < 3; ++k) {
            kept.store(tag, hn::LoadU(tag, boxes.lower[k] + i), to.lower[k].data() + to.count);
            kept.store(tag, hn::LoadU(tag, boxes.upper[k] + i), to.upper[k].data() + to.count);
        }
        kept.store(IndexTag(), nodes, to.nodes.data() + to.count);
        to.count += kept.count();
    }
};

// Does the work of collectNodes().
inline void narrowList(const WideTree& tree, const NodeList& from, const VoxelBox& voxels, float reach, float largest,
                       NodeList& to) {
    const Tag tag;
    to.count = 0;
    Narrowing narrowing{tree, voxels, reach * reach * roundUp, largest, to};
    const BoxArrays boxes(from);
    for (std::size_t i = 0; i < from.count; i += hn::Lanes(tag))
        narrowing.take(boxes, i, hn::LoadU(Narrowing::IndexTag(), from.nodes.data() + i),
                       hn::FirstN(tag, from.count - i));
}

}  // namespace
}  // namespace bilayer::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
