// SPDX-License-Identifier: Apache-2.0
#include "sdf/tiles/flood_regions.h"

#include <oneapi/tbb/parallel_for.h>

#include <utility>

#include "sdf/sign/flood_growth.h"

namespace bilayer::detail {
namespace {

/// The set of the space beyond all tiles. The smallest number stays a root.
constexpr std::uint32_t beyondTiles = 0;

constexpr BlockMask wholeBlock{~0ull, ~0ull, ~0ull, ~0ull, ~0ull, ~0ull, ~0ull, ~0ull};

glm::ivec3 nextBlock(glm::ivec3 block, int axis, int side) {
    block[axis] += side == 0 ? -blockSide : blockSide;
    return block;
}

glm::ivec3 firstOf(const BandLeaf& leaf) {
    return {leaf.origin().x(), leaf.origin().y(), leaf.origin().z()};
}

// The sets that regions of neighbouring tiles belong to.
class BorderJoiner {
  public:
    BorderJoiner(DisjointSets& sets, std::span<const std::uint32_t> first) : sets_(sets), first_(first) {}

    // Joins the regions of two tiles that touch across a side of the first one.
    void join(const FloodBorder& a, std::size_t tileA, const FloodBorder& b, std::size_t tileB, int axis, int side) {
        if (a.isEmpty && b.isEmpty) return joinSets(tileA, 0, tileB, 0);
        if (a.isEmpty) return join(b, tileB, a, tileA, axis, 1 - side);
        const BlockMask facing = across(wholeBlock, axis, side);
        const int layer = side == 0 ? a.own.first[axis] : a.own.end[axis] - blockSide;
        for (const SpaceRow& row : a.space)
            for (int i = 0; i < row.blocks; ++i) {
                const glm::ivec3 block = row.first + glm::ivec3(0, 0, i * blockSide);
                if (block[axis] == layer) joinTo(tileA, row.region, facing, b, tileB, nextBlock(block, axis, side));
            }
        for (const BorderLeaf& leaf : a.leaves) {
            if (leaf.first[axis] != layer) continue;
            for (const BorderLeaf::Part& part : leaf.parts) {
                const BlockMask touching = across(part.voxels, axis, side);
                if (any(touching)) joinTo(tileA, part.region, touching, b, tileB, nextBlock(leaf.first, axis, side));
            }
        }
    }

  private:
    // Joins a region with those of a block of another tile that share a voxel with a mask.
    void joinTo(std::size_t tile, std::uint64_t region, const BlockMask& mask, const FloodBorder& other,
                std::size_t otherTile, const glm::ivec3& block) {
        if (const auto space = other.spaceAt(block)) return joinSets(tile, region, otherTile, *space);
        const BorderLeaf* leaf = other.leafAt(block);
        if (!leaf) return;
        for (const BorderLeaf::Part& part : leaf->parts)
            if (meet(mask, part.voxels)) joinSets(tile, region, otherTile, part.region);
    }

    void joinSets(std::size_t tileA, std::uint64_t a, std::size_t tileB, std::uint64_t b) {
        sets_.join(first_[tileA] + std::uint32_t(a), first_[tileB] + std::uint32_t(b));
    }

    DisjointSets& sets_;
    std::span<const std::uint32_t> first_;
};

}  // namespace

FloodRegions::FloodRegions(std::span<BandLeaf* const> leaves, const BlockBox& own, const BlockBox& box, float free)
    : own_(own), box_(box), size_((box.end - box.first) / blockSide), parts_(leaves.size()), sets_(0) {
    leafAt_.assign(std::size_t(size_.x) * std::size_t(size_.y) * std::size_t(size_.z), noLeaf);
    for (std::size_t i = 0; i < leaves.size(); ++i) leafAt_[numberOf(firstOf(*leaves[i]))] = std::uint32_t(i);
    tbb::parallel_for(std::size_t(0), leaves.size(),
                      [&](std::size_t i) { parts_[i].masks = freeParts(leaves[i]->buffer().data(), free); });
    std::size_t count = 1 + leafAt_.size();
    for (LeafParts& parts : parts_) {
        parts.first = std::uint32_t(count);
        count += parts.masks.size();
    }
    sets_ = DisjointSets(count);
    glm::ivec3 at;
    for (at.x = box_.first.x; at.x < box_.end.x; at.x += blockSide)
        for (at.y = box_.first.y; at.y < box_.end.y; at.y += blockSide)
            for (at.z = box_.first.z; at.z < box_.end.z; at.z += blockSide) join(at);
    makeBorder(leaves);
}

std::size_t FloodRegions::numberOf(const glm::ivec3& block) const {
    const glm::ivec3 at = (block - box_.first) / blockSide;
    return (std::size_t(at.x) * std::size_t(size_.y) + std::size_t(at.y)) * std::size_t(size_.z) + std::size_t(at.z);
}

// Visits the sets of a block, and their voxels within a mask.
template <class Visit>
void FloodRegions::forEachPart(const glm::ivec3& block, const BlockMask& within, const Visit& visit) const {
    const std::size_t number = numberOf(block);
    if (leafAt_[number] == noLeaf) return visit(std::uint32_t(1 + number), within);
    const LeafParts& parts = parts_[leafAt_[number]];
    for (std::size_t p = 0; p < parts.masks.size(); ++p) {
        BlockMask mask = parts.masks[p];
        for (std::size_t x = 0; x < blockSide; ++x) mask[x] &= within[x];
        if (any(mask)) visit(parts.first + std::uint32_t(p), mask);
    }
}

// Joins a block with those above it, and with the space beyond all tiles.
void FloodRegions::join(const glm::ivec3& block) {
    for (int axis = 0; axis < 3; ++axis)
        for (int side = 0; side < 2; ++side) {
            const glm::ivec3 next = nextBlock(block, axis, side);
            const bool isWithin = box_.contains(next);
            if (isWithin ? side == 0 : !own_.contains(next)) continue;
            forEachPart(block, across(wholeBlock, axis, 1 - side), [&](std::uint32_t set, const BlockMask& voxels) {
                if (!isWithin) return void(sets_.join(beyondTiles, set));
                const BlockMask touching = across(voxels, axis, side);
                forEachPart(next, touching, [&](std::uint32_t other, const BlockMask&) { sets_.join(set, other); });
            });
        }
}

std::uint32_t FloodRegions::numberOfRegion(std::uint32_t set) {
    const std::uint32_t root = sets_.root(set);
    const auto [region, isNew] = regions_.try_emplace(root, std::uint32_t(border_.open.size()));
    if (isNew) border_.open.push_back(root == beyondTiles);
    return region->second;
}

bool FloodRegions::isInside(std::uint32_t set, const RegionSides& sides) {
    const std::uint32_t root = sets_.root(set);
    if (root == beyondTiles) return false;
    const auto region = regions_.find(root);
    return region == regions_.end() || sides[region->second] != 0;
}

bool FloodRegions::isInside(const glm::ivec3& block, const RegionSides& sides) {
    return isInside(std::uint32_t(1 + numberOf(block)), sides);
}

BlockMask FloodRegions::freeVoxels(std::size_t leaf, const RegionSides& sides, BlockMask& inside) {
    const LeafParts& parts = parts_[leaf];
    BlockMask free{};
    for (std::size_t p = 0; p < parts.masks.size(); ++p) {
        const bool in = isInside(parts.first + std::uint32_t(p), sides);
        for (std::size_t x = 0; x < blockSide; ++x) {
            free[x] |= parts.masks[p][x];
            if (in) inside[x] |= parts.masks[p][x];
        }
    }
    return free;
}

void FloodRegions::makeBorder(std::span<BandLeaf* const> leaves) {
    border_.own = own_;
    glm::ivec3 at;
    for (at.x = box_.first.x; at.x < box_.end.x; at.x += blockSide)
        for (at.y = box_.first.y; at.y < box_.end.y; at.y += blockSide)
            for (at.z = box_.first.z; at.z < box_.end.z; at.z += blockSide) {
                bool isAtBorder = false;
                for (int axis = 0; axis < 3; ++axis)
                    isAtBorder |= at[axis] == own_.first[axis] || at[axis] + blockSide == own_.end[axis];
                if (!isAtBorder) continue;
                const std::uint32_t leaf = leafAt(at);
                addToBorder(at, leaf == noLeaf ? nullptr : leaves[leaf]);
            }
}

void FloodRegions::addToBorder(const glm::ivec3& block, const BandLeaf* leaf) {
    if (!leaf) {
        const std::uint32_t region = numberOfRegion(std::uint32_t(1 + numberOf(block)));
        if (!border_.space.empty()) {
            SpaceRow& last = border_.space.back();
            if (last.region == region && last.first + glm::ivec3(0, 0, last.blocks * blockSide) == block) {
                ++last.blocks;
                return;
            }
        }
        border_.space.push_back({block, 1, region});
        return;
    }
    const BlockMask voxels = borderVoxels(own_, block);
    BorderLeaf& added = border_.leaves.emplace_back(BorderLeaf{block, {}, {}});
    forEachPart(block, voxels, [&](std::uint32_t set, const BlockMask& mask) {
        added.parts.push_back({numberOfRegion(set), mask});
    });
    for (unsigned voxel = 0; voxel < blockVoxels; ++voxel)
        if (test(voxels, voxel)) added.distances.push_back(leaf->buffer().data()[voxel]);
}

std::vector<RegionSides> joinRegions(const Tiling& tiling, const std::function<FloodBorder(std::size_t)>& borderOf) {
    std::vector<std::uint32_t> first;
    std::vector<std::uint32_t> open;
    std::uint32_t count = beyondTiles + 1;
    for (std::size_t tile = 0; tile < tiling.size(); ++tile) {
        first.push_back(count);
        for (const std::uint8_t isOpen : borderOf(tile).open) {
            if (isOpen) open.push_back(count);
            ++count;
        }
    }
    first.push_back(count);
    DisjointSets sets(count);
    for (const std::uint32_t region : open) sets.join(beyondTiles, region);
    BorderJoiner joiner(sets, first);
    for (std::size_t tile = 0; tile < tiling.size(); ++tile) {
        const FloodBorder border = borderOf(tile);
        for (int axis = 0; axis < 3; ++axis) {
            glm::ivec3 next = tiling.place(tile);
            if (++next[axis] == tiling.counts()[axis]) continue;
            const std::size_t other = tiling.tileAt(next);
            joiner.join(border, tile, borderOf(other), other, axis, 1);
        }
    }
    std::vector<RegionSides> sides(tiling.size());
    for (std::size_t tile = 0; tile < tiling.size(); ++tile)
        for (std::uint32_t region = first[tile]; region < first[tile + 1]; ++region)
            sides[tile].push_back(sets.root(region) != beyondTiles);
    return sides;
}

}  // namespace bilayer::detail
