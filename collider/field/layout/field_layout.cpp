// SPDX-License-Identifier: Apache-2.0
// Construction of field layouts.
#include "collider/field/layout/field_layout.h"

#include <fmt/format.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/parallel_sort.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <utility>

#include <bilayer/sdf/grids.h>
#include "collider/field/layout/block_summary.h"
#include "collider/field/layout/coarse_distance.h"
#include "collider/field/layout/leaf_block.h"
#include "sdf/base/morton.h"
#include "sdf/base/openvdb.h"

namespace bilayer::detail {
namespace {

using openvdb::Coord;
using openvdb::FloatTree;
using Accessor = openvdb::FloatGrid::ConstAccessor;

constexpr int side = FieldLayout::side;
constexpr std::int64_t maxBlocks = 1 << 26;        // of the box: 0.75 GiB at 12 bytes each
constexpr std::int64_t maxBlocksAround = 1 << 27;  // of a tile with those around it: 2 GiB for a moment, 16 bytes each
constexpr int minSteps = 126;                      // from 0 to the end of the band, for the stored minima

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

// Fills the blocks and enters them in the directory. Returns where the surface may meet them.
std::vector<SurfaceBlock> enterBlocks(FieldLayout& field, const FloatTree& tree, const std::vector<Coord>& origins,
                                      const Coord& first) {
    field.stored = origins.size();
    const std::size_t floats = field.stored * FieldLayout::blockFloats;
    if (field.storage == Storage::float32)
        field.values = LargeArray<float>(floats);
    else
        field.values16 = LargeArray<std::int16_t>(floats);
    field.minima = LargeArray<std::int8_t>(field.stored * Clearance::blockCells);
    std::vector<SurfaceBlock> surface(field.stored);
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
            surface[i] = {{origins[i].x(), origins[i].y(), origins[i].z()}, summary.meetsSurface};
            for (int k = 0; k < Clearance::blockCells; ++k)
                field.minima[i * Clearance::blockCells + k] =
                    std::int8_t(std::clamp(std::floor(summary.lowest[k] / minimaStep), -127.f, 127.f));
        }
    });
    return surface;
}

double count(const glm::ivec3& blocks) {
    return double(blocks.x) * blocks.y * blocks.z;
}

// The leaves in a box that need a block.
std::vector<Coord> storedBlocks(const FloatTree& tree, const openvdb::CoordBBox& within) {
    std::vector<Coord> origins;
    for (auto leaf = tree.cbeginLeaf(); leaf; ++leaf)
        if (within.isInside(leaf->origin()) && needsBlock(*leaf)) origins.push_back(leaf->origin());
    return origins;
}

glm::dvec3 placeOf(const openvdb::FloatGrid& grid, const Coord& voxel) {
    const openvdb::Vec3d p = grid.indexToWorld(voxel);
    return {p.x(), p.y(), p.z()};
}

// Fills the arrays of a field whose box is known, but for the distances to the surface. Returns where the surface may
// meet the blocks.
std::vector<SurfaceBlock> enter(FieldLayout& field, const openvdb::FloatGrid& grid, std::vector<Coord> origins,
                                const Coord& first) {
    sortAlongMortonCurve(origins, first);
    field.origin = placeOf(grid, first);
    enterSides(field, grid.tree(), first);
    return enterBlocks(field, grid.tree(), origins, first);
}

}  // namespace

void FieldFrame::requireSize() const {
    if (count(blocks) > double(maxBlocks))
        throw std::invalid_argument("the bounds hold more than 2^26 blocks of 8^3 voxels: take larger voxels");
    requireLength();
}

void FieldFrame::requireSizeOfTile() const {
    requireSize();
    if (findsSurface() && count(blocks + 2 * clearanceReach) > double(maxBlocksAround))
        throw std::invalid_argument(fmt::format(
            "a tile with the {} blocks around it holds more than 2^27 blocks of 8^3 voxels: take more tiles",
            clearanceReach));
}

void FieldFrame::requireLength() const {
    if (std::max({blocks.x, blocks.y, blocks.z}) > maxBlocksAlong) throwTooLong();
}

bool FieldFrame::findsSurface() const {
    return std::min(exteriorWidth, interiorWidth) >= nearSurface * voxelSize;
}

FieldLayout::FieldLayout(const LevelSet& levelSet, Storage storage)
    : FieldLayout(FieldFrame{.voxel = levelSet.grids().distance->voxelSize()[0],
                             .voxelSize = levelSet.voxelSize(),
                             .exteriorWidth = levelSet.exteriorWidth(),
                             .interiorWidth = levelSet.interiorWidth()},
                  storage) {
    const openvdb::FloatGrid& grid = *levelSet.grids().distance;
    std::vector<Coord> origins = storedBlocks(grid.tree(), openvdb::CoordBBox::inf());
    if (origins.empty()) throw std::invalid_argument("the level set has no voxel in its band");
    openvdb::CoordBBox box;
    for (const Coord& block : origins) box.expand(block);

    // in 64 bits: the extent of a file's data may exceed an int
    for (int axis = 0; axis < 3; ++axis)
        if (std::int64_t(box.max()[axis]) - box.min()[axis] >= std::int64_t(side) * maxBlocksAlong) throwTooLong();

    const Coord first = box.min();
    blocks = glm::ivec3((box.max() - first).x(), (box.max() - first).y(), (box.max() - first).z()) / side + 1;
    requireSize();
    const std::vector<SurfaceBlock> surface = enter(*this, grid, std::move(origins), first);
    measureClearances(*this, {first.x(), first.y(), first.z()}, surface, 0);
    const openvdb::CoordBBox active = grid.evalActiveVoxelBoundingBox();
    bounds = {glm::vec3(placeOf(grid, active.min())), glm::vec3(placeOf(grid, active.max()))};
}

FieldLayout::FieldLayout(const FieldFrame& frame, const Grids& grids, const LayoutTile& tile, Storage storage)
    : FieldLayout(frame, storage) {
    blocks = tile.blocks;
    requireSizeOfTile();
    const Coord first(tile.first.x, tile.first.y, tile.first.z);
    const auto box =
        openvdb::CoordBBox(first, first + Coord(side * blocks.x - 1, side * blocks.y - 1, side * blocks.z - 1));
    const openvdb::FloatGrid& grid = *grids.distance;
    enter(*this, grid, storedBlocks(grid.tree(), box), first);
    measureClearances(*this, tile.first, tile.surface, clearanceReach);
}

FieldLayout::FieldLayout(const FieldFrame& frame, Storage storage)
    : FieldFrame(frame), storage(storage), step(std::max(exteriorWidth, interiorWidth) / float(beyondOutside - 1)) {
    perMetre = 1 / voxel;
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
