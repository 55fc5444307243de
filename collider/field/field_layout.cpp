// Construction of field layouts. Outside the band, distances are bounded from below by a coarse exact distance
// transform of the cells that the surface may meet.
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
constexpr int maxParts = 16;                      // distance limit of the bounds [coarse cells]
constexpr float nearSurface = 0.5f * 1.7320508f;  // max distance from surface in a cell to its nearest voxel [voxels]
constexpr int minSteps = 126;                     // from 0 to the end of the band, for the stored minima

// Squared distances from the centres of coarse cells to the nearest one that the surface meets. The unit is half a
// coarse cell, so that distances to faces are integers.
using Way = std::int16_t;
constexpr Way farAway = 4 * maxParts * maxParts;

// A leaf needs a block if it has voxels of the band, or voxels of both signs (for bands below one voxel).
bool needsBlock(const FloatTree::LeafNodeType& leaf) {
    if (!leaf.getValueMask().isOff()) return true;
    const auto [low, high] = std::minmax_element(leaf.buffer().data(), leaf.buffer().data() + side * side * side);
    return (*low < 0) != (*high < 0);
}

[[noreturn]] void throwTooLong() {
    throw std::invalid_argument("field: the bounds are longer than 2^19 blocks of 8^3 voxels: take larger voxels");
}

// Sorts blocks in Morton order, so that blocks that are close in space are close in memory.
void sortForWalks(std::vector<Coord>& origins, const Coord& first) {
    const auto place = [&](const Coord& origin) -> std::array<std::uint32_t, 3> {
        const Coord way = origin - first;
        return {std::uint32_t(way.x()), std::uint32_t(way.y()), std::uint32_t(way.z())};
    };
    tbb::parallel_sort(origins.begin(), origins.end(),
                       [&](const Coord& a, const Coord& b) { return beforeInMortonOrder(place(a), place(b)); });
}

// Copies a leaf, and the first layer of voxels of its seven upper neighbours.
void copyBlock(const Accessor& tree, const Coord& origin, float* block) {
    for (int part = 0; part < 8; ++part) {
        const glm::ivec3 first = side * glm::ivec3(part >> 2, part >> 1 & 1, part & 1);
        const glm::ivec3 count = glm::min(glm::ivec3(side), stride - first);
        const Coord corner = origin.offsetBy(first.x, first.y, first.z);
        const auto* leaf = tree.probeConstLeaf(corner);
        const float* values = leaf ? leaf->buffer().data() : nullptr;
        const float tile = leaf ? 0.f : tree.getValue(corner);
        for (int x = 0; x < count.x; ++x)
            for (int y = 0; y < count.y; ++y) {
                float* row = block + ((first.x + x) * stride + first.y + y) * stride + first.z;
                if (values)
                    std::copy_n(values + (x * side + y) * side, count.z, row);
                else
                    std::fill_n(row, count.z, tile);
            }
    }
}

// The unit of stored minima [m].
float minimaStepOf(const FieldFrame& frame) {
    return std::max(frame.exteriorWidth, frame.interiorWidth) / float(minSteps);
}

// Summary of a block's coarse cells.
struct BlockSummary {
    std::array<float, blockParts> least;        // min value of the voxels around each coarse cell [m]
    std::array<bool, blockParts> meetsSurface;  // a voxel is close enough to the surface, or both signs occur
};

using Floats [[gnu::vector_size(16)]] = float;

// Minima and maxima of a quarter of a block, over x and y, by place along the last axis.
struct Quarter {
    float least[stride], most[stride];

    explicit Quarter(const float* rows) {
        for (int z = 0; z < stride; z += 4) {
            // the last four overlap the previous ones
            const float* from = rows + std::min(z, stride - 4);
            Floats low, high;
            std::memcpy(&low, from, sizeof low);
            high = low;
            for (int x = 0; x <= partSide; ++x)
                for (int y = 0; y <= partSide; ++y) {
                    Floats values;
                    std::memcpy(&values, from + (x * stride + y) * stride, sizeof values);
                    low = values < low ? values : low;
                    high = values > high ? values : high;
                }
            std::memcpy(least + std::min(z, stride - 4), &low, sizeof low);
            std::memcpy(most + std::min(z, stride - 4), &high, sizeof high);
        }
    }
};

BlockSummary summaryOf(const float* block, float voxelSize) {
    BlockSummary summary;
    for (int i = 0; i < blockParts; i += perBlock) {
        const Quarter quarter(block + partSide * stride * ((i >> 2) * stride + (i >> 1 & 1)));
        for (int part = 0; part < perBlock; ++part) {
            const int first = part * partSide;
            const float least = *std::min_element(&quarter.least[first], &quarter.least[first] + partSide + 1),
                        most = *std::max_element(&quarter.most[first], &quarter.most[first] + partSide + 1);
            summary.least[i + part] = least;
            summary.meetsSurface[i + part] =
                std::min(std::abs(least), std::abs(most)) <= nearSurface * voxelSize || (least < 0) != (most < 0);
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
    constexpr float most = FieldLayout::beyondOutside - 1;
    for (int i = 0; i < FieldLayout::blockFloats; ++i) {
        const auto steps = std::int16_t(std::clamp(std::nearbyint(block[i] / step), -most, most));
        const std::int16_t beyond = block[i] < 0 ? FieldLayout::beyondInside : FieldLayout::beyondOutside;
        to[i] = isBeyondBand(block[i], frame) ? beyond : steps;
    }
}

// The increase of a squared distance to the near face of a coarse cell `d` places away.
constexpr Way wayTo(int d) {
    return Way((2 * d - 1) * (2 * d - 1));
}

// Lowers squared distances to those of others plus an increment. Returns false if no larger increment can lower any.
bool lower(Way* ways, const Way* others, std::size_t count, Way way) {
    Way most = 0;
    for (std::size_t i = 0; i < count; ++i) {
        most = std::max(most, ways[i]);
        ways[i] = std::min(ways[i], Way(others[i] + way));
    }
    return most > way;
}

// Lowers each squared distance along the last axis to the minimum of the others plus their increments (as P.
// Felzenszwalb, D. Huttenlocher, "Distance transforms of sampled functions", 2012, but to the faces of coarse cells).
void transformRow(Way* ways, int length, std::vector<Way>& before) {
    before.assign(ways, ways + length);
    for (int d = 1; d <= std::min(maxParts, length - 1); ++d) {
        const std::size_t count = length - d;
        const bool up = lower(ways + d, before.data(), count, wayTo(d));
        const bool down = lower(ways, before.data() + d, count, wayTo(d));
        if (!up && !down) break;
    }
}

// The same across rows of `count` values with a stride of `step`.
void transformRows(Way* ways, std::size_t count, std::size_t step, int length, std::vector<Way>& before) {
    before.resize(std::size_t(length) * count);
    for (int i = 0; i < length; ++i) std::copy_n(ways + i * step, count, before.data() + i * count);
    for (int i = 0; i < length; ++i) {
        bool more = true;
        for (int d = 1; more && d <= maxParts; ++d) {
            more = false;
            if (i >= d) more |= lower(ways + i * step, before.data() + (i - d) * count, count, wayTo(d));
            if (i + d < length) more |= lower(ways + i * step, before.data() + (i + d) * count, count, wayTo(d));
        }
    }
}

// Distance transform. Input: 0 for coarse cells that meet the surface, `farAway` for others. Processes one axis after
// the other, since a squared distance is a sum over the axes.
void transform(LargeArray<Way>& ways, const glm::ivec3& size) {
    const std::size_t row = std::size_t(size.z), plane = size.y * row;
    tbb::parallel_for(0, size.x, [&](int x) {
        std::vector<Way> before;
        for (int y = 0; y < size.y; ++y) transformRow(ways.data() + x * plane + y * row, size.z, before);
        transformRows(ways.data() + x * plane, row, row, size.y, before);
    });
    tbb::parallel_for(0, size.y, [&](int y) {
        std::vector<Way> before;
        transformRows(ways.data() + y * row, row, plane, size.x, before);
    });
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
                    std::int8_t(std::clamp(std::floor(summary.least[k] / minimaStep), -127.f, 127.f));
        }
    });
    return meets;
}

// Calls visit(entry, index) for the entries of the directory, with the index of their first coarse cell. nextParts()
// returns the offsets of the others.
template <class Visit>
void forEachEntry(const FieldLayout& field, const Visit& visit) {
    const glm::ivec3 size = field.parts();
    tbb::parallel_for(0, field.blocks.x, [&](int x) {
        for (int y = 0; y < field.blocks.y; ++y) {
            const std::size_t entry = field.entryOf({x, y, 0});
            const std::size_t part = (std::size_t(perBlock * x) * size.y + std::size_t(perBlock * y)) * size.z;
            for (int z = 0; z < field.blocks.z; ++z) visit(entry + std::size_t(z), part + std::size_t(perBlock * z));
        }
    });
}

std::array<std::size_t, blockParts> nextParts(const FieldLayout& field) {
    const glm::ivec3 size = field.parts();
    std::array<std::size_t, blockParts> next;
    for (int k = 0; k < blockParts; ++k)
        next[k] = (std::size_t(k >> 2) * size.y + std::size_t(k >> 1 & 1)) * size.z + std::size_t(k & 1);
    return next;
}

// The square roots of all squared distances, rounded down [steps].
std::array<std::int8_t, farAway + 1> rootsOfWays() {
    std::array<std::int8_t, farAway + 1> roots;
    for (int way = 0; way <= farAway; ++way)
        roots[way] =
            std::int8_t(std::min(Clearance::maxDistanceSteps, int(0.5f * Clearance::steps * std::sqrt(float(way)))));
    return roots;
}

void measureClearances(FieldLayout& field, const std::vector<std::array<bool, blockParts>>& meets) {
    field.centres = LargeArray<std::int8_t>(field.entries() * blockParts);
    if (!field.findsSurface()) {
        std::fill_n(field.centres.data(), field.centres.size(), std::int8_t(0));
        return;
    }
    const glm::ivec3 size = field.parts();
    LargeArray<Way> ways(std::size_t(size.x) * size.y * size.z);
    const auto next = nextParts(field);
    forEachEntry(field, [&](std::size_t entry, std::size_t part) {
        const std::int32_t block = field.directory[entry];
        for (int k = 0; k < blockParts; ++k) ways[part + next[k]] = block >= 0 && meets[block][k] ? 0 : farAway;
    });
    transform(ways, size);
    const auto roots = rootsOfWays();
    forEachEntry(field, [&](std::size_t entry, std::size_t part) {
        const std::int32_t block = field.directory[entry];
        const bool emptyInside = block == FieldLayout::emptyInside;
        std::int8_t* const centres = field.centres.data() + entry * blockParts;
        for (int k = 0; k < blockParts; ++k) {
            const std::int8_t root = roots[ways[part + next[k]]];
            const bool inside = block < 0 ? emptyInside : field.minima[std::size_t(block) * blockParts + k] < 0;
            centres[k] = std::int8_t(inside ? -root : root);
        }
    });
}

}  // namespace

void FieldFrame::requireSize() const {
    if (double(blocks.x) * blocks.y * blocks.z > double(maxBlocks))
        throw std::invalid_argument("field: the bounds hold more than 2^26 blocks of 8^3 voxels: take larger voxels");
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
    if (origins.empty()) throw std::invalid_argument("field: the level set has no voxel in its band");

    // in 64 bits: the extent of a file's data may exceed an int
    for (int axis = 0; axis < 3; ++axis)
        if (std::int64_t(box.max()[axis]) - box.min()[axis] >= std::int64_t(side) * maxBlocksAlong) throwTooLong();

    const Coord first = box.min();
    sortForWalks(origins, first);
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
                      .besides = {exteriorWidth, -interiorWidth},
                      .blocks = blocks});
}

std::size_t FieldLayout::memoryBytes() const {
    return sizeof *this + directory.bytes() + centres.bytes() + minima.bytes() + values.bytes() + values16.bytes();
}

}  // namespace bilayer::detail
