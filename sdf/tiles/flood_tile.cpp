// SPDX-License-Identifier: Apache-2.0
#include "sdf/tiles/flood_tile.h"

#include <fmt/format.h>
#include <oneapi/tbb/parallel_for.h>
#include <openvdb/tools/Prune.h>

#include <stdexcept>
#include <utility>

#include "sdf/grid/vdb_grids.h"
#include "sdf/leaf/build_options.h"

namespace bilayer::detail {
namespace {

glm::ivec3 ivecOf(const openvdb::Coord& c) {
    return {c.x(), c.y(), c.z()};
}

std::uint32_t spaceNumber(bool inside) {
    return inside ? FloodLeaf::insideSpace : FloodLeaf::outsideSpace;
}

template <class Visit>
void forEachBlockOf(const BlockBox& box, Visit visit) {
    for (int x = box.first.x; x < box.end.x; x += blockSide)
        for (int y = box.first.y; y < box.end.y; y += blockSide)
            for (int z = box.first.z; z < box.end.z; z += blockSide) visit(glm::ivec3(x, y, z));
}

// Returns on which sides the voxels of a box lie, in a tree without leaves that is outside elsewhere.
VoxelSides sidesWithin(const openvdb::FloatTree& tree, const BlockBox& box) {
    double inside = 0;
    for (auto tile = tree.cbeginValueOff(); tile; ++tile)
        if (*tile < 0) inside += double(tile.getVoxelCount());
    const glm::dvec3 size(box.end - box.first);
    const bool hasOutside = inside<size.x * size.y * size.z, hasInside = inside> 0;
    return {hasOutside, hasInside};
}

}  // namespace

FloodTile::FloodTile(std::shared_ptr<Grids> grids, const Tiling& tiling, std::size_t tile, const BuildOptions& options)
    : grids_(std::move(grids)),
      distance_(openvdb::ConstPtrCast<openvdb::FloatGrid>(grids_->distance)),
      options_(options),
      part_{tiling.mesh(), 0, tiling.lattice(), tiling.own(tile), {}},
      filled_(part_.filled().within(part_.lattice)),
      bandLeaves_(leavesOf(*distance_)),
      regions_(bandLeaves_, part_.own, part_.own.within(part_.lattice),
               freeDistance(options.gapVoxels, options.voxelSize)) {}

// Space of the neighbours is outside until they are added.
void FloodTile::need(const BlockBox& blocks) {
    forEachBlockOf(blocks.within(part_.lattice), [&](const glm::ivec3& block) {
        if (!part_.own.contains(block)) beyond_.try_emplace(coordOf(block), FloodLeaf::outsideSpace);
    });
}

void FloodTile::setSides(const RegionSides& sides) {
    sides_ = sides;
    for (const BandLeaf* from : bandLeaves_) {
        FloodLeaf& leaf = leaves_.emplace_back();
        leaf.origin = from->origin();
        leaf.distances = from->buffer().data();
        leaf.known = regions_.freeVoxels(leaves_.size() - 1, sides_, leaf.inside);
        const glm::ivec3 first = ivecOf(leaf.origin);
        leaf.watched = borderVoxels(part_.own, first);
        if (any(leaf.watched)) need({first - blockSide, first + 2 * blockSide});
    }
    for (int axis = 0; axis < 3; ++axis) {
        BlockBox above = filled_;
        above.first[axis] = part_.own.end[axis];
        need(above);
    }
}

void FloodTile::add(const FloodNeighbour& neighbour) {
    for (auto& [block, number] : beyond_) {
        const glm::ivec3 first = ivecOf(block);
        if (!neighbour.border.own.contains(first)) continue;
        if (const auto region = neighbour.border.spaceAt(first)) {
            number = spaceNumber(neighbour.sides.at(*region) != 0);
        } else if (const BorderLeaf* leaf = neighbour.border.leafAt(first)) {
            addLeaf(neighbour, *leaf, number);
        } else {
            throw std::runtime_error(
                fmt::format("a tile's border lacks the block at {}, {}, {}: remove the folder `work` of the tiles",
                            first.x, first.y, first.z));
        }
    }
    addArrivals(neighbour.byDistance, byDistance_);
    addArrivals(neighbour.byTriangles, byTriangles_);
}

void FloodTile::addLeaf(const FloodNeighbour& neighbour, const BorderLeaf& leaf, std::uint32_t& number) {
    number = std::uint32_t(leaves_.size());
    FloodLeaf& added = leaves_.emplace_back();
    Distances& distances = distances_.emplace_back();
    distances.fill(0);
    const BlockMask voxels = borderVoxels(neighbour.border.own, leaf.first);
    std::size_t next = 0;
    for (unsigned voxel = 0; voxel < blockVoxels; ++voxel)
        if (test(voxels, voxel)) distances[voxel] = leaf.distances.at(next++);
    added.origin = coordOf(leaf.first);
    added.distances = distances.data();
    for (const BorderLeaf::Part& part : leaf.parts)
        for (std::size_t x = 0; x < blockSide; ++x) {
            added.known[x] |= part.voxels[x];
            if (neighbour.sides.at(part.region)) added.inside[x] |= part.voxels[x];
        }
}

void FloodTile::addArrivals(const std::vector<BorderArrival>& from, std::vector<FloodArrival>& to) const {
    for (const BorderArrival& arrival : from) {
        const auto found = beyond_.find(coordOf(arrival.leaf));
        if (found == beyond_.end() || found->second >= leaves_.size()) continue;
        to.push_back({found->second, arrival.step, arrival.voxel, arrival.inside != 0});
    }
}

std::uint32_t FloodTile::numberAt(const glm::ivec3& block) {
    if (regions_.box().contains(block)) {
        const std::uint32_t leaf = regions_.leafAt(block);
        return leaf != FloodRegions::noLeaf ? leaf : spaceNumber(regions_.isInside(block, sides_));
    }
    const auto found = beyond_.find(coordOf(block));
    return found == beyond_.end() ? FloodLeaf::outsideSpace : found->second;
}

void FloodTile::findNeighbours() {
    for (std::size_t i = 0; i < bandLeaves_.size(); ++i)
        for (int n = 0; n < 27; ++n) {
            const glm::ivec3 step(n / 9 - 1, n / 3 % 3 - 1, n % 3 - 1);
            leaves_[i].around[std::size_t(n)] = numberAt(ivecOf(leaves_[i].origin) + blockSide * step);
        }
}

FloodGrowth FloodTile::growth() {
    return {leaves_, bandLeaves_.size(), distance_->background(), options_.voxelSize, nullptr};
}

std::vector<BorderArrival> FloodTile::growByDistance() {
    findNeighbours();
    growth().growByDistance(byDistance_);
    return arrivals();
}

std::vector<BorderArrival> FloodTile::growByTriangles(const WindingNumber& triangles) {
    growth().growByTriangles(triangles, byTriangles_);
    return arrivals();
}

std::vector<BorderArrival> FloodTile::arrivals() const {
    std::vector<BorderArrival> all;
    for (std::size_t i = 0; i < bandLeaves_.size(); ++i)
        for (const FloodArrival& a : leaves_[i].arrivals)
            all.push_back({ivecOf(leaves_[i].origin), a.step, a.voxel, std::uint16_t(a.inside)});
    return all;
}

// The leaves and the space of the tile, and those of the next layer above it as far as its neighbours state them.
openvdb::FloatTree::Ptr FloodTile::signedTree() {
    const BandWidths widths = bandOf(options_);
    const float exterior = widths.exterior * widths.voxelSize, interior = widths.interior * widths.voxelSize;
    const auto tree = std::make_shared<openvdb::FloatTree>(exterior);
    openvdb::tree::ValueAccessor<openvdb::FloatTree> blocks(*tree);
    forEachBlockOf(filled_, [&](const glm::ivec3& block) {
        if (numberAt(block) == FloodLeaf::insideSpace) blocks.addTile(1, coordOf(block), -interior, false);
    });
    tbb::parallel_for(std::size_t(0), bandLeaves_.size(),
                      [&](std::size_t i) { signLeaf(*bandLeaves_[i], leaves_[i].inside, widths); });
    std::vector<BandLeaf*> own;
    distance_->tree().stealNodes(own);
    for (BandLeaf* leaf : own) blocks.addLeaf(leaf);
    for (std::size_t i = bandLeaves_.size(); i < leaves_.size(); ++i) {
        const FloodLeaf& from = leaves_[i];
        if (!filled_.contains(ivecOf(from.origin))) continue;
        auto* leaf = new BandLeaf(from.origin, exterior);
        std::copy_n(from.distances, blockVoxels, leaf->buffer().data());
        signLeaf(*leaf, from.inside, widths);
        blocks.addLeaf(leaf);
    }
    return tree;
}

BuiltTile FloodTile::signedTile() {
    growth().settle();
    const openvdb::FloatTree::Ptr tree = signedTree();
    distance_->setTree(tree);
    BuiltTile built;
    built.faces = faceSides(*tree, part_);
    const openvdb::FloatGrid::Ptr border = openvdb::FloatGrid::create(borderOf(*tree, part_));
    border->setName(borderGrid);
    border->setTransform(distance_->transform().copy());
    trimToPart(*tree, part_);
    openvdb::tools::prune(*tree);
    if (tree->leafCount() == 0) {
        const VoxelSides sides = sidesWithin(*tree, regions_.box());
        built.inside = sides.inside;
        if (!sides.inside || !sides.outside) return built;
    }
    if (grids_->triangle) keepActive(openvdb::ConstPtrCast<openvdb::Int32Grid>(grids_->triangle)->tree(), *tree);
    built.grids = grids_;
    built.border = border;
    return built;
}

}  // namespace bilayer::detail
