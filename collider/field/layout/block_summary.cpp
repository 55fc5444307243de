// SPDX-License-Identifier: Apache-2.0
#include "collider/field/layout/block_summary.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "collider/field/layout/leaf_block.h"

namespace bilayer::detail {
namespace {

constexpr int stride = FieldFrame::stride;
constexpr int cellSide = Clearance::cellSide;

// Minima and maxima of a quarter of a block, over x and y, by place along the last axis.
struct Quarter {
    using FourFloats [[gnu::vector_size(16)]] = float;

    float lowest[stride], highest[stride];

    explicit Quarter(const float* rows) {
        for (int z = 0; z < stride; z += 4) {
            // the last four overlap the previous ones
            const float* from = rows + std::min(z, stride - 4);
            FourFloats low, high;
            std::memcpy(&low, from, sizeof low);
            high = low;
            for (int x = 0; x <= cellSide; ++x)
                for (int y = 0; y <= cellSide; ++y) {
                    FourFloats values;
                    std::memcpy(&values, from + (x * stride + y) * stride, sizeof values);
                    low = values < low ? values : low;
                    high = values > high ? values : high;
                }
            std::memcpy(lowest + std::min(z, stride - 4), &low, sizeof low);
            std::memcpy(highest + std::min(z, stride - 4), &high, sizeof high);
        }
    }
};

}  // namespace

bool needsBlock(const openvdb::FloatTree::LeafNodeType& leaf) {
    if (!leaf.getValueMask().isOff()) return true;
    const auto [low, high] =
        std::minmax_element(leaf.buffer().data(), leaf.buffer().data() + openvdb::FloatTree::LeafNodeType::SIZE);
    return (*low < 0) != (*high < 0);
}

BlockSummary summaryOf(const float* block, float voxelSize) {
    BlockSummary summary;
    for (int i = 0; i < Clearance::blockCells; i += Clearance::perBlock) {
        const Quarter quarter(block + cellSide * stride * ((i >> 2) * stride + (i >> 1 & 1)));
        for (int cell = 0; cell < Clearance::perBlock; ++cell) {
            const int first = cell * cellSide;
            const float lowest = *std::min_element(&quarter.lowest[first], &quarter.lowest[first] + cellSide + 1),
                        highest = *std::max_element(&quarter.highest[first], &quarter.highest[first] + cellSide + 1);
            summary.lowest[i + cell] = lowest;
            const bool isNear = std::min(std::abs(lowest), std::abs(highest)) <= nearSurface * voxelSize;
            if (isNear || (lowest < 0) != (highest < 0)) summary.meetsSurface |= std::uint32_t(1) << (i + cell);
        }
    }
    return summary;
}

std::vector<SurfaceBlock> surfaceBlocks(const openvdb::FloatTree& tree, const openvdb::CoordBBox& box,
                                        float voxelSize) {
    const openvdb::FloatGrid::ConstAccessor values(tree);
    std::vector<SurfaceBlock> blocks;
    std::array<float, FieldFrame::blockFloats> block;
    for (auto leaf = tree.cbeginLeaf(); leaf; ++leaf) {
        const openvdb::Coord& first = leaf->origin();
        if (!box.isInside(first) || !needsBlock(*leaf)) continue;
        copyBlock(values, first, block.data());
        blocks.push_back({{first.x(), first.y(), first.z()}, summaryOf(block.data(), voxelSize).meetsSurface});
    }
    return blocks;
}

}  // namespace bilayer::detail
