// SPDX-License-Identifier: Apache-2.0
#include "sdf/grid/vdb_grids.h"

#include <fmt/format.h>
#include <openvdb/io/Stream.h>
#include <openvdb/tree/LeafManager.h>

#include <cmath>
#include <fstream>
#include <limits>
#include <stdexcept>
#include <string>

#include "sdf/base/openvdb.h"
#include "sdf/base/quoted_text.h"
#include "sdf/io/input_file.h"
#include "sdf/io/mapped_file.h"
#include "sdf/io/vdb/vdb_archive.h"
#include "sdf/io/vdb/vdb_checksum.h"
#include "sdf/io/vdb/vdb_lengths.h"

namespace bilayer::detail {
namespace {

/// Max error of a voxel's edge in a file, relative: a hundredth of a voxel over a thousand voxels.
constexpr double maxVoxelRounding = 1e-5;

template <class Grid>
typename Grid::Ptr first(const openvdb::GridPtrVec& grids, auto accept) {
    for (const auto& base : grids)
        if (auto grid = openvdb::gridPtrCast<Grid>(base); grid && accept(*grid)) return grid;
    return nullptr;
}

std::ifstream opened(const std::filesystem::path& path) {
    std::ifstream stream(path, std::ios::binary);
    stream.exceptions(std::ios::failbit | std::ios::badbit);
    return stream;
}

void shift(openvdb::GridBase& grid, const glm::dvec3& by) {
    if (by == glm::dvec3(0)) return;
    const openvdb::math::Transform::Ptr shifted = grid.transform().copy();
    shifted->postTranslate({by.x, by.y, by.z});
    grid.setTransform(shifted);
}

/// Far from zero, OpenVDB finds the edge of a voxel as the difference of two rounded positions.
void requireVoxels(const openvdb::GridBase& grid) {
    const double away = grid.indexToWorld(openvdb::Vec3d(0)).length() / grid.voxelSize()[0];  // [voxels]
    const double rounding = 0.5 * std::numeric_limits<double>::epsilon() * away;
    if (rounding <= maxVoxelRounding) return;
    throw std::invalid_argument(fmt::format(
        "grid {} lies {:.3g} voxels from zero, where a file rounds voxels by {:.1g} of their size and {:g} is "
        "allowed: move the mesh closer to zero, or take larger voxels",
        quotedWord(grid.getName()), away, rounding, maxVoxelRounding));
}

/// Deactivates the voxels and tiles of a dense array that other programs clamp to the width of the band: they hold no
/// distance.
void deactivateClamped(openvdb::FloatGrid& grid) {
    if (grid[metadata::interiorWidth] || grid[metadata::version]) return;
    const float width = grid.background(), rounding = halfRounding * width;
    auto tile = grid.tree().beginValueOn();
    tile.setMaxDepth(openvdb::FloatTree::ValueOnIter::LEAF_DEPTH - 1);
    for (; tile; ++tile)
        if (std::isfinite(*tile) && std::abs(*tile) >= width - rounding) {
            tile.setValue(std::copysign(width, *tile));
            tile.setActiveState(false);
        }
    openvdb::tree::LeafManager<openvdb::FloatTree>(grid.tree()).foreach ([&](auto& leaf, std::size_t) {
        for (auto voxel = leaf.beginValueOn(); voxel; ++voxel)
            if (std::abs(*voxel) == width) voxel.setValueOff();
    });
}

/// Returns the origin of the mesh from which a field in a file was built.
glm::dvec3 originOf(const openvdb::GridPtrVec& grids) {
    for (const auto& grid : grids)
        if (const auto entry = grid->getMetadata<openvdb::Vec3DMetadata>(metadata::origin)) {
            const openvdb::Vec3d& origin = entry->value();
            return {origin.x(), origin.y(), origin.z()};
        }
    return glm::dvec3(0);
}

openvdb::GridPtrVec readAll(const std::filesystem::path& path) {
    openvdb::initialize();
    requireInputFile(path);
    openvdb::GridPtrVec grids;
    try {
        requireChecksum(MappedFile(path).bytes());
        std::ifstream stream = opened(path);
        requireLengths(stream, std::filesystem::file_size(path));
        stream.seekg(0);
        // With delayed loading, the values and any damage to them would stay in the file.
        grids = *openvdb::io::Stream(stream, /*delayLoad=*/false).getGrids();
        const glm::dvec3 origin = originOf(grids);
        for (const auto& grid : grids) shift(*grid, -origin);
    } catch (const std::exception& error) {
        throw std::runtime_error(
            fmt::format("{}: is not a .vdb file, or is damaged ({})", path.string(), oneLine(error.what())));
    }
    return grids;
}

std::shared_ptr<Grids> fieldOf(const openvdb::GridPtrVec& grids, const std::filesystem::path& path) {
    auto result = std::make_shared<Grids>();
    const auto distance = first<openvdb::FloatGrid>(
        grids, [](const auto& grid) { return grid.getGridClass() == openvdb::GRID_LEVEL_SET; });
    if (distance) deactivateClamped(*distance);
    result->distance = distance;
    if (!result->distance) throw std::runtime_error(fmt::format("{}: holds no level set", path.string()));
    result->triangle = first<openvdb::Int32Grid>(grids, [](const auto& grid) { return grid.getName() == "triangle"; });
    for (const auto& grid : grids)
        if (grid->getName() == contactPoints) result->points = grid;
    return result;
}

}  // namespace

std::shared_ptr<Grids> readGrids(const std::filesystem::path& path) {
    return fieldOf(readAll(path), path);
}

TileGrids readTile(const std::filesystem::path& path) {
    const openvdb::GridPtrVec grids = readAll(path);
    const auto border = first<openvdb::FloatGrid>(grids, [](const auto& grid) { return grid.getName() == borderGrid; });
    if (!border) throw std::runtime_error(fmt::format("{}: is no tile: it has no grid 'border'", path.string()));
    return {fieldOf(grids, path), border};
}

void addBorder(openvdb::FloatTree& tile, const openvdb::FloatTree& border) {
    for (auto leaf = border.cbeginLeaf(); leaf; ++leaf) tile.addLeaf(new openvdb::FloatTree::LeafNodeType(*leaf));
    auto space = border.cbeginValueOff();
    space.setMaxDepth(openvdb::FloatTree::ValueOffCIter::LEAF_DEPTH - 1);
    for (; space; ++space)
        if (*space != border.background()) tile.addTile(space.getLevel(), space.getCoord(), *space, false);
}

openvdb::GridBase::Ptr withOrigin(const openvdb::GridBase::ConstPtr& grid, const glm::dvec3& origin) {
    const openvdb::GridBase::Ptr copy = openvdb::ConstPtrCast<openvdb::GridBase>(grid)->copyGrid();
    shift(*copy, origin);
    requireVoxels(*copy);
    return copy;
}

}  // namespace bilayer::detail
