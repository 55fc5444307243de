// SPDX-License-Identifier: Apache-2.0
// Construction of field layouts.
#include "collider/field/field_layout.h"

#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/parallel_sort.h>
#include <openvdb/tree/LeafManager.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <stdexcept>

#include <bilayer/sdf/grids.h>
#include "collider/field/coarse_distance.h"
#include "collider/field/interpolant.h"
#include "collider/field/leaf_block.h"
#include "sdf/base/morton.h"
#include "sdf/base/openvdb.h"

namespace bilayer::detail {
namespace {

using openvdb::Coord;
using openvdb::FloatTree;
using Accessor = openvdb::FloatGrid::ConstAccessor;

constexpr int side = FieldLayout::side, stride = FieldLayout::stride;
constexpr std::int64_t maxBlocks = 1 << 26;  // of the box: 0.75 GiB at 12 bytes each
constexpr int partSide = Clearance::partSide, perBlock = Clearance::perBlock, blockParts = Clearance::blockParts;
constexpr float nearSurface = 0.5f * cellDiagonal;  // max distance from surface in a cell to its nearest voxel [voxels]
constexpr int minSteps = 126;                       // from 0 to the end of the band, for the stored minima

// A leaf needs a block if it has voxels of the band, or voxels of both signs (for bands below one voxel).
bool needsBlock(const FloatTree::LeafNodeType& leaf) {
    if (!leaf.getValueMask().isOff()) return true;
    const auto [low, high] = std::minmax_element(leaf.buffer().data(), leaf.buffer().data() + side * side * side);
    return (*low < 0) != (*high < 0);
}

[[noreturn]] void throwTooLong() {
    throw std::invalid_argument("the bounds are longer than 2^19 blocks of 8^3 voxels: take larger voxels");
}

// Sorts blocks in Morton order, so that blocks that are close in space are close in memory.
void sortAlongMortonCurve(std::vector<Coord>& origins, const Coord& first) {
    const auto place = [&](const Coord& origin) -> std::array<std::uint32_t, 3> {
        const Coord offset = origin - first;
        return {std::uint32_t(offset.x()), std::uint32_t(offset.y()), std::uint32_t(offset.z())};
    };
    tbb::parallel_sort(origins.begin(), origins.end(),
                       [&](const Coord& a, const Coord& b) { return beforeInMortonOrder(place(a), place(b)); });
}

// The unit of stored minima [m].
float minimaStepOf(const FieldFrame& frame) {
    return std::max(frame.exteriorWidth, frame.interiorWidth) / float(minSteps);
}

// Summary of a block's coarse cells.
struct BlockSummary {
    std::array<float, blockParts> lowest;       // min value of the voxels around each coarse cell [m]
    std::array<bool, blockParts> meetsSurface;  // a voxel is close enough to the surface, or both signs occur
};

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
            for (int x = 0; x <= partSide; ++x)
                for (int y = 0; y <= partSide; ++y) {
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

BlockSummary summaryOf(const float* block, float voxelSize) {
    BlockSummary summary;
    for (int i = 0; i < blockParts; i += perBlock) {
        const Quarter quarter(block + partSide * stride * ((i >> 2) * stride + (i >> 1 & 1)));
        for (int part = 0; part < perBlock; ++part) {
            const int first = part * partSide;
            const float lowest = *std::min_element(&quarter.lowest[first], &quarter.lowest[first] + partSide + 1),
                        highest = *std::max_element(&quarter.highest[first], &quarter.highest[first] + partSide + 1);
            summary.lowest[i + part] = lowest;
            summary.meetsSurface[i + part] = std::min(std::abs(lowest), std::abs(highest)) <= nearSurface * voxelSize ||
                                             (lowest < 0) != (highest < 0);
        }
    }
    return summary;
}

bool isBeyondBand(float value, const FieldFrame& frame) {
    return value >= frame.exteriorWidth || value <= -frame.interiorWidth;
}

// Stores values, with marks for those outside the band.
void store(const float* block, const FieldFrame& frame, float* to) {
    constexpr float beyond = std::numeric_limits<float>::quiet_NaN();
    for (int i = 0; i < FieldLayout::blockFloats; ++i)
        to[i] = isBeyondBand(block[i], frame) ? std::copysign(beyond, block[i]) : block[i];
}

// Stores values in steps, with marks for those outside the band.
void store(const float* block, const FieldFrame& frame, float step, std::int16_t* to) {
    constexpr float maxSteps = FieldLayout::beyondOutside - 1;
    for (int i = 0; i < FieldLayout::blockFloats; ++i) {
        const auto steps = std::int16_t(std::clamp(std::nearbyint(block[i] / step), -maxSteps, maxSteps));
        const std::int16_t beyond = block[i] < 0 ? FieldLayout::beyondInside : FieldLayout::beyondOutside;
        to[i] = isBeyondBand(block[i], frame) ? beyond : steps;
    }
}

// Enters the side of each directory entry, before the blocks are entered.
void enterSides(FieldLayout& field, const FloatTree& tree, const Coord& first) {
    field.directory = LargeArray<std::int32_t>(field.entries());
    tbb::parallel_for(0, field.blocks.x, [&](int x) {
        const Accessor accessor(tree);
        for (int y = 0; y < field.blocks.y; ++y)
            for (int z = 0; z < field.blocks.z; ++z) {
                const float value = accessor.getValue(first.offsetBy(side * x, side * y, side * z));
                field.directory[field.entryOf({x, y, z})] =
                    value < 0 ? FieldLayout::emptyInside : FieldLayout::emptyOutside;
            }
    });
}

// Fills the blocks and enters them in the directory. Returns whether the surface meets each of their coarse cells.
std::vector<std::array<bool, blockParts>> enterBlocks(FieldLayout& field, const FloatTree& tree,
                                                      const std::vector<Coord>& origins, const Coord& first) {
    field.stored = origins.size();
    const std::size_t floats = field.stored * FieldLayout::blockFloats;
    if (field.storage == Storage::float32)
        field.values = LargeArray<float>(floats);
    else
        field.values16 = LargeArray<std::int16_t>(floats);
    field.minima = LargeArray<std::int8_t>(field.stored * blockParts);
    std::vector<std::array<bool, blockParts>> meets(field.stored);
    const float minimaStep = minimaStepOf(field);
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, field.stored), [&](const auto& range) {
        const Accessor accessor(tree);
        std::array<float, FieldLayout::blockFloats> block;
        for (std::size_t i = range.begin(); i < range.end(); ++i) {
            const Coord at = (origins[i] - first) >> 3;
            field.directory[field.entryOf({at.x(), at.y(), at.z()})] = std::int32_t(i);
            copyBlock(accessor, origins[i], block.data());
            if (field.storage == Storage::float32)
                store(block.data(), field, field.values.data() + i * FieldLayout::blockFloats);
            else
                store(block.data(), field, field.step, field.values16.data() + i * FieldLayout::blockFloats);
            const BlockSummary summary = summaryOf(block.data(), field.voxelSize);
            meets[i] = summary.meetsSurface;
            for (int k = 0; k < blockParts; ++k)
                field.minima[i * blockParts + k] =
                    std::int8_t(std::clamp(std::floor(summary.lowest[k] / minimaStep), -127.f, 127.f));
        }
    });
    return meets;
}

}  // namespace

void FieldFrame::requireSize() const {
    if (double(blocks.x) * blocks.y * blocks.z > double(maxBlocks))
        throw std::invalid_argument("the bounds hold more than 2^26 blocks of 8^3 voxels: take larger voxels");
    if (std::max({blocks.x, blocks.y, blocks.z}) > maxBlocksAlong) throwTooLong();
}

bool FieldFrame::findsSurface() const {
    return std::min(exteriorWidth, interiorWidth) >= nearSurface * voxelSize;
}

FieldLayout::FieldLayout(const LevelSet& levelSet, Storage storage)
    : FieldFrame{.voxel = levelSet.grids().distance->voxelSize()[0],
                 .voxelSize = levelSet.voxelSize(),
                 .exteriorWidth = levelSet.exteriorWidth(),
                 .interiorWidth = levelSet.interiorWidth()},
      storage(storage),
      step(std::max(exteriorWidth, interiorWidth) / float(beyondOutside - 1)) {
    perMetre = 1 / voxel;
    const openvdb::FloatGrid& grid = *levelSet.grids().distance;
    const openvdb::tree::LeafManager<const FloatTree> leaves(grid.tree());
    std::vector<Coord> origins;
    openvdb::CoordBBox box;
    for (std::size_t i = 0; i < leaves.leafCount(); ++i)
        if (needsBlock(leaves.leaf(i))) {
            origins.push_back(leaves.leaf(i).origin());
            box.expand(origins.back());
        }
    if (origins.empty()) throw std::invalid_argument("the level set has no voxel in its band");

    // in 64 bits: the extent of a file's data may exceed an int
    for (int axis = 0; axis < 3; ++axis)
        if (std::int64_t(box.max()[axis]) - box.min()[axis] >= std::int64_t(side) * maxBlocksAlong) throwTooLong();

    const Coord first = box.min();
    sortAlongMortonCurve(origins, first);
    blocks = glm::ivec3((box.max() - first).x(), (box.max() - first).y(), (box.max() - first).z()) / side + 1;
    requireSize();
    enterSides(*this, grid.tree(), first);
    measureClearances(*this, enterBlocks(*this, grid.tree(), origins, first));

    const auto world = [&](const Coord& voxel) {
        const openvdb::Vec3d p = grid.indexToWorld(voxel);
        return glm::dvec3(p.x(), p.y(), p.z());
    };
    origin = world(first);
    const openvdb::CoordBBox active = grid.evalActiveVoxelBoundingBox();
    bounds = {glm::vec3(world(active.min())), glm::vec3(world(active.max()))};
}

FieldLayout FieldLayout::shared() const {
    FieldLayout other{FieldFrame(*this)};
    other.directory = directory.shared();
    other.centres = centres.shared();
    other.minima = minima.shared();
    other.storage = storage;
    other.values = values.shared();
    other.values16 = values16.shared();
    other.step = step;
    other.stored = stored;
    return other;
}

Clearance FieldLayout::clearance() const {
    return Clearance({.directory = directory.data(),
                      .centres = centres.data(),
                      .minima = minima.data(),
                      .minimaStep = minimaStepOf(*this),
                      .ofEmptyBlocks = {exteriorWidth, -interiorWidth},
                      .blocks = blocks});
}

std::size_t FieldLayout::memoryBytes() const {
    return sizeof *this + directory.bytes() + centres.bytes() + minima.bytes() + values.bytes() + values16.bytes();
}

}  // namespace bilayer::detail
