// SPDX-License-Identifier: Apache-2.0
#include "collider/field/tiled/tiled_field_data.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <glm/common.hpp>
#include <limits>
#include <span>
#include <stdexcept>
#include <utility>

#include <bilayer/sdf/grids.h>
#include "collider/field/layout/outer_bound.h"
#include "collider/field/layout/surface_file.h"
#include "sdf/base/openvdb.h"
#include "sdf/grid/distance_check.h"
#include "sdf/grid/vdb_grids.h"
#include "sdf/io/input_file.h"
#include "sdf/tiles/tile_merge.h"

namespace bilayer::detail {
namespace {

constexpr int blockEdgeVoxels = FieldFrame::side;

// Of a place along one axis, in the fixed point of samples. Unsigned: negative, huge and NaN coordinates are out of
// range of any directory.
std::uint32_t blockAlong(double perMetre, double offset, float coordinate) {
    const auto word = [](double fixed) { return std::uint32_t(std::bit_cast<std::uint64_t>(fixed) >> 32); };
    return word(double(coordinate) * perMetre + offset) - word(FieldData::fixedPoint);
}

bool overlap(const PlacedTile& a, const PlacedTile& b, int margin) {
    const glm::ivec3 reach(margin);
    return glm::all(glm::lessThan(a.first - reach, b.first + blockEdgeVoxels * b.blocks)) &&
           glm::all(glm::lessThan(b.first, a.first + blockEdgeVoxels * a.blocks + reach));
}

/// The grids of a tile's file; the distances with those of its border.
std::shared_ptr<Grids> gridsOf(const TileRecord& tile) {
    tile.field.requireIntact();
    const TileGrids read = readTile(tile.field.path);
    addBorder(openvdb::ConstPtrCast<openvdb::FloatGrid>(read.grids->distance)->tree(), read.border->tree());
    return read.grids;
}

void requireWithin(const TileRecord& tile, std::span<const SurfaceBlock> blocks) {
    const auto isWithin = [&](const SurfaceBlock& block) {
        return tile.box.contains(block.first) && (block.first - tile.box.first) % blockEdgeVoxels == glm::ivec3(0);
    };
    if (!std::all_of(blocks.begin(), blocks.end(), isWithin))
        throw std::runtime_error(fmt::format("{}: has a block that is not in its tile", tile.cells.path.string()));
}

}  // namespace

TiledFieldData::TiledFieldData(const std::filesystem::path& folder, std::size_t budget, Storage storage)
    : manifest_(readTileManifest(folder)), storage_(storage) {
    readSurface();
    namingFile(folder, [&] { readFrame(); });
    placeTiles();
    namingFile(folder, [&] { requireSizes(); });
    std::vector<std::size_t> sizes;
    for (std::size_t tile = 0; tile < tileCount(); ++tile) sizes.push_back(bytesOf(tile));
    cache_ = std::make_unique<TileCache>(budget, std::move(sizes), [this](std::size_t tile) { return read(tile); });
}

std::size_t TiledFieldData::memoryBytes() const {
    return sizeof *this + surface_.capacity() * sizeof(SurfaceBlock) +
           tileCount() * (sizeof(TileRecord) + sizeof(PlacedTile)) + cache_->memoryBytes();
}

void TiledFieldData::readSurface() {
    for (const TileRecord& record : manifest_.tiles) {
        const std::size_t before = surface_.size();
        if (!record.cells.path.empty()) {
            record.cells.requireIntact();
            readSurfaceBlocks(record.cells.path, surface_);
            requireWithin(record, std::span(surface_).subspan(before));
        }
        placed_.push_back(
            {.first{}, .blocks{}, .lower{}, .upper{}, .shift{}, .surface = before, .surfaceEnd = surface_.size()});
    }
}

// Reads the smallest tile for what all tiles share.
void TiledFieldData::readFrame() {
    const auto count = [&](std::size_t tile) { return placed_[tile].surfaceEnd - placed_[tile].surface; };
    std::optional<std::size_t> smallest;
    glm::ivec3 lower(std::numeric_limits<int>::max()), upper(std::numeric_limits<int>::min());
    for (std::size_t tile = 0; tile < tileCount(); ++tile) {
        const TileRecord& record = manifest_.tiles[tile];
        if (!record.hasBand) continue;
        if (!smallest || count(tile) < count(*smallest)) smallest = tile;
        lower = glm::min(lower, record.band.first);
        upper = glm::max(upper, record.band.end - 1);
    }
    if (!smallest || surface_.empty()) throw std::invalid_argument("has no voxel in its band");
    const TileRecord& record = manifest_.tiles[*smallest];
    const LevelSet tile = namingFile(record.field.path, [&] { return LevelSet(gridsOf(record)); });
    const openvdb::FloatGrid& grid = *tile.grids().distance;
    Grids pattern;
    pattern.distance = grid.copyWithNewTree();
    pattern_ = std::make_shared<const Grids>(std::move(pattern));
    const auto placeOf = [&](const glm::ivec3& voxel) {
        const openvdb::Vec3d p = grid.indexToWorld(openvdb::Coord(voxel.x, voxel.y, voxel.z));
        return glm::dvec3(p.x(), p.y(), p.z());
    };
    glm::ivec3 end(std::numeric_limits<int>::min());
    first_ = glm::ivec3(std::numeric_limits<int>::max());
    for (const SurfaceBlock& block : surface_) {
        first_ = glm::min(first_, block.first);
        end = glm::max(end, block.first + blockEdgeVoxels);
    }
    frame_.voxel = grid.voxelSize()[0];
    frame_.perMetre = 1 / frame_.voxel;
    frame_.voxelSize = tile.voxelSize();
    frame_.exteriorWidth = tile.exteriorWidth();
    frame_.interiorWidth = tile.interiorWidth();
    frame_.blocks = (end - first_) / blockEdgeVoxels;
    frame_.requireLength();
    frame_.origin = placeOf(first_);
    frame_.bounds = {glm::vec3(placeOf(lower)), glm::vec3(placeOf(upper))};
    fixedOffset_ = FieldData::fixedPoint - frame_.origin * frame_.perMetre;
}

// The lower neighbours belong to a tile's directory: a point on the border may be rounded to either side.
void TiledFieldData::placeTiles() {
    const glm::ivec3 end = first_ + blockEdgeVoxels * frame_.blocks;
    for (std::size_t tile = 0; tile < tileCount(); ++tile) {
        const BlockBox& box = manifest_.tiles[tile].box;
        PlacedTile& placed = placed_[tile];
        placed.first = glm::max(box.first - blockEdgeVoxels, first_);
        placed.blocks = glm::max((glm::min(box.end, end) - placed.first) / blockEdgeVoxels, glm::ivec3(0));
        placed.shift = glm::dvec3(placed.first - first_);
        placed.lower = glm::dvec3(glm::max(box.first, first_) - first_);
        placed.upper = glm::dvec3(glm::min(box.end, end) - first_);
    }
    for (int axis = 0; axis < 3; ++axis)
        for (int i = 0; i < manifest_.counts[axis]; ++i) {
            glm::ivec3 place(0);
            place[axis] = i;
            starts_[std::size_t(axis)].push_back((manifest_.tiles[manifest_.at(place)].box.first[axis] - first_[axis]) /
                                                 blockEdgeVoxels);
        }
}

void TiledFieldData::requireSizes() const {
    for (const PlacedTile& placed : placed_) {
        FieldFrame frame = frame_;
        frame.blocks = placed.blocks;
        frame.requireSizeOfTile();
    }
}

glm::ivec3 TiledFieldData::placeOf(const glm::ivec3& block) const {
    glm::ivec3 place;
    for (int axis = 0; axis < 3; ++axis) {
        const std::vector<int>& starts = starts_[std::size_t(axis)];
        place[axis] = int(std::upper_bound(starts.begin() + 1, starts.end(), block[axis]) - starts.begin()) - 1;
    }
    return place;
}

std::optional<std::size_t> TiledFieldData::tileOf(const glm::vec3& point) const {
    glm::ivec3 block;
    for (int axis = 0; axis < 3; ++axis) {
        const std::uint32_t at = blockAlong(frame_.perMetre, fixedOffset_[axis], point[axis]);
        if (at >= std::uint32_t(frame_.blocks[axis])) return std::nullopt;
        block[axis] = int(at);
    }
    return tileAt(placeOf(block));
}

Sample TiledFieldData::sample(const glm::vec3& point, std::optional<std::size_t> tile) const {
    if (!tile) return {.distance = boundOutside(frame_, frame_.toLocal(point))};
    return sampleIn(*hold(*tile), *tile, point);
}

// In voxels, the step from the field's first voxel to the tile's is exact.
Sample TiledFieldData::sampleIn(const FieldData& data, std::size_t tile, const glm::vec3& point) const {
    return data.kernels.sampleInTile(data, {point, frame_.toLocal(point) - placed_[tile].shift});
}

// As FieldData::memoryBytes() will be, but for the rounding of allocations.
std::size_t TiledFieldData::bytesOf(std::size_t tile) const {
    const PlacedTile& placed = placed_[tile];
    const std::size_t entries =
        std::size_t(placed.blocks.x) * std::size_t(placed.blocks.y) * std::size_t(placed.blocks.z);
    const std::size_t value = storage_ == Storage::float32 ? sizeof(float) : sizeof(std::int16_t);
    return sizeof(FieldData) + entries * (sizeof(std::int32_t) + Clearance::blockCells) +
           (placed.surfaceEnd - placed.surface) * (FieldFrame::blockFloats * value + Clearance::blockCells);
}

std::shared_ptr<const FieldData> TiledFieldData::read(std::size_t tile) const {
    const TileRecord& record = manifest_.tiles[tile];
    Grids grids;
    if (record.field.path.empty()) {
        const auto grid = openvdb::FloatGrid::create(record.inside ? -frame_.interiorWidth : frame_.exteriorWidth);
        grid->setTransform(openvdb::math::Transform::createLinearTransform(frame_.voxel));
        grids.distance = grid;
    } else {
        grids.distance = gridsOf(record)->distance;
        namingFile(record.field.path, [&] {
            requireSameField(*pattern_->distance, *grids.distance);
            requireValidDistances(*grids.distance, frame_.interiorWidth);
        });
    }
    const std::vector<SurfaceBlock> surface = surfaceAround(placed_[tile]);
    const LayoutTile layout{placed_[tile].first, placed_[tile].blocks, surface};
    return std::make_shared<const FieldData>(FieldLayout(frame_, grids, layout, storage_));
}

std::vector<SurfaceBlock> TiledFieldData::surfaceAround(const PlacedTile& tile) const {
    std::vector<SurfaceBlock> around;
    for (const PlacedTile& other : placed_)
        if (overlap(tile, other, blockEdgeVoxels * clearanceReach))
            around.insert(around.end(), surface_.begin() + std::ptrdiff_t(other.surface),
                          surface_.begin() + std::ptrdiff_t(other.surfaceEnd));
    return around;
}

}  // namespace bilayer::detail
