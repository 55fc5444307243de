// SPDX-License-Identifier: Apache-2.0
#include "sdf/tiles/tile_merge.h"

#include <fmt/format.h>

#include <stdexcept>
#include <string>

#include "sdf/base/method_names.h"
#include "sdf/base/openvdb.h"
#include "sdf/sign/octree_cells.h"

namespace bilayer::detail {
namespace {

template <class Value>
Value entryOf(const openvdb::FloatGrid& tile, const char* key) {
    const auto entry = tile.getMetadata<openvdb::TypedMetadata<Value>>(key);
    if (!entry) throw std::invalid_argument(fmt::format("a tile has no entry '{}'", key));
    return entry->value();
}

// The entries that describe the field, which all of its tiles share but for the counts of voxels.
openvdb::FloatGrid::Ptr withoutTree(const openvdb::FloatGrid& tile) {
    auto grid = openvdb::FloatGrid::create(tile.background());
    for (auto entry = tile.beginMeta(); entry != tile.endMeta(); ++entry)
        if (entry->first.starts_with("bilayer:")) grid->insertMeta(entry->first, *entry->second);
    grid->setTransform(tile.transform().copy());
    grid->setCreator("bilayer");
    return grid;
}

bool isFlooded(const openvdb::FloatGrid& tile) {
    return entryOf<std::string>(tile, metadata::sign) == nameOf(Sign::flood);
}

// Blocks without a voxel in the band are in the tiles if the field needs them, so none is dropped.
constexpr auto plain = Assembler::Plain::keep;

}  // namespace

void requireSameField(const openvdb::FloatGrid& first, const openvdb::FloatGrid& tile) {
    const auto refuse = [](const std::string& what) {
        throw std::invalid_argument(fmt::format("two tiles are of different fields: their {} differ", what));
    };
    if (tile.background() != first.background()) refuse("band widths");
    if (tile.voxelSize() != first.voxelSize() || tile.transform() != first.transform())
        refuse("voxel sizes or origins");
    for (auto entry = first.beginMeta(); entry != first.endMeta(); ++entry) {
        const std::string& key = entry->first;
        if (!key.starts_with("bilayer:") || key == metadata::signUndecided) continue;
        const openvdb::Metadata::ConstPtr other = tile[key];
        if (!other || *other != *entry->second) refuse(fmt::format("entries '{}'", key));
    }
}

void TileMerger::begin(const openvdb::FloatGrid& first, bool triangles) {
    const float h = float(first.voxelSize()[0]);
    const float interior = entryOf<float>(first, metadata::interiorWidth);
    first_ = withoutTree(first);
    assembler_.emplace(BandWidths{first.background() / h, interior / h, h}, triangles, plain, progress_);
}

void TileMerger::addSpace(const openvdb::FloatGrid& tile) {
    auto space = tile.cbeginValueOff();
    space.setMaxDepth(openvdb::FloatGrid::ValueOffCIter::LEAF_DEPTH - 1);
    for (; space; ++space)
        if (*space < 0) inside_.push_back(space.getBoundingBox());
}

void TileMerger::add(const Grids& tile) {
    if (!assembler_) begin(*tile.distance, tile.triangle != nullptr);
    requireSameField(*first_, *tile.distance);
    undecided_ += entryOf<std::int64_t>(*tile.distance, metadata::signUndecided);
    assembler_->copy(tile, [](const openvdb::Coord&) { return true; });
    if (isFlooded(*first_)) addSpace(*tile.distance);
}

LevelSet TileMerger::merged() {
    if (!assembler_) throw std::invalid_argument("no tile has a voxel in the band");
    const float interior = -entryOf<float>(*first_, metadata::interiorWidth);
    const openvdb::FloatGrid::Ptr distance = assembler_->distances(first_->background(), interior);
    distance->setTransform(first_->transform().copy());
    if (isFlooded(*first_)) assemble(*distance, inside_, first_->background(), interior, &progress_);
    const bool byNormals = entryOf<std::string>(*first_, metadata::sign) == nameOf(Sign::normals);
    if (const std::size_t conflicts = byNormals ? assembler_->conflicts(*distance) : 0)
        throw std::invalid_argument(fmt::format("the signs of tiles contradict each other at {} places", conflicts));
    distance->insertMeta(*first_);
    distance->insertMeta(metadata::signUndecided, openvdb::Int64Metadata(undecided_));
    const auto grids = std::make_shared<Grids>();
    grids->distance = distance;
    if (const openvdb::Int32Grid::Ptr triangle = assembler_->triangles()) {
        triangle->setTransform(distance->transformPtr());
        grids->triangle = triangle;
    }
    return LevelSet(grids);
}

}  // namespace bilayer::detail
