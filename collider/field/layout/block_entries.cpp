// SPDX-License-Identifier: Apache-2.0
#include "collider/field/layout/block_entries.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>
#include <vector>

#include "sdf/bvh/node_list.h"

namespace bilayer::detail {
namespace {

/// Max offset between the frames of field and tree [voxels], and max rounding of floats in the tree, relative to its
/// size.
constexpr float frameRounding = 1e-2f, treeRounding = 3e-7f;
/// Max count of nodes in a cube's entries.
constexpr std::size_t maxNodes = BlockEntries::maxEntries * BlockEntry::slots;
/// Entries are sized for the nodes of this fraction of the cubes; the other cubes use a coarser level. The size is
/// estimated from `samples` cubes.
constexpr double usual = 0.9;
constexpr std::size_t samples = 512;
constexpr std::uint32_t maxTreeNodes = 1 << 24;
constexpr std::size_t cubesPerTask = 256;
/// log2 of a cube's side [voxels]. A cube is one block, or larger if `fewEntries` entries hold the leaves near it.
/// These are read as fast as one, and all of them fit into a cache that is too small for entries of single blocks.
constexpr int blockShift = 3, maxShift = 5, fewEntries = 2;
static_assert(FieldFrame::side == 1 << blockShift);

struct Region {
    glm::vec3 lower, upper;
    float reach2;
};

// Makes room for a whole group: all of its boxes are written, also those that are not kept.
void makeRoom(NodeList& list) {
    if (list.count + 2 * treeWidth > list.nodes.size()) list.makeRoom(treeWidth);
}

// Adds a node with an unknown box.
void add(std::uint32_t node, const Region& region, NodeList& to) {
    makeRoom(to);
    for (int k = 0; k < 3; ++k) {
        to.lower[k][to.count] = region.lower[k];
        to.upper[k][to.count] = region.upper[k];
    }
    to.nodes[to.count++] = node;
}

// Adds the children of a group that are near a region.
void addNear(const BoxGroup& group, const Region& region, NodeList& to) {
    float sums[treeWidth] = {};
    for (int k = 0; k < 3; ++k)
        for (int i = 0; i < treeWidth; ++i) {
            const float gap =
                std::max(std::max(0.f, group.lower[k][i] - region.upper[k]), region.lower[k] - group.upper[k][i]);
            sums[i] += gap * gap;
        }
    makeRoom(to);
    for (int i = 0; i < treeWidth; ++i) {
        for (int k = 0; k < 3; ++k) {
            to.lower[k][to.count] = group.lower[k][i];
            to.upper[k][to.count] = group.upper[k][i];
        }
        to.nodes[to.count] = group.firstChild + std::uint32_t(i);
        to.count += sums[i] <= region.reach2;
    }
}

// Builds the entries of one cube after another.
class EntryBuilder {
  public:
    EntryBuilder(const FieldLayout& field, const WideTree& tree, double perMetre, float reach, int shift)
        : tree_(tree),
          origin_(field.origin * perMetre - glm::dvec3(tree.base)),
          side_(float(1 << shift)),
          step_(double(side_) * field.voxel * perMetre),
          reach_(reach),
          margin_(frameRounding + treeRounding * float(std::max({tree.size.x, tree.size.y, tree.size.z}))) {}

    // The count of nodes near a cube, at the finest level that fits into entries, and whether they are leaves.
    std::pair<std::size_t, bool> count(const glm::ivec3& cube) {
        descend(cube);
        const NodeList& finest = levels_[count_ - 1];
        return {finest.count, finest.count == 0 || tree_.isLeaf(finest.nodes[0])};
    }

    void make(const glm::ivec3& cube, BlockEntry* to, int each) {
        descend(cube);
        std::size_t level = count_ - 1;
        while (levels_[level].count > std::size_t(each * BlockEntry::slots)) --level;
        write(levels_[level], lowerOf(cube) - reach_, to, each);
    }

  private:
    glm::vec3 lowerOf(const glm::ivec3& cube) const { return glm::vec3(origin_ + step_ * glm::dvec3(cube)); }

    // Finds the nodes near a cube, level by level from the root, until there are too many.
    void descend(const glm::ivec3& cube) {
        const glm::vec3 lower = lowerOf(cube);
        const Region region{lower - margin_, lower + side_ + margin_, reach_ * reach_};
        count_ = 0;
        add(tree_.root(), region, next());
        while (levels_[count_ - 1].count > 0 && !tree_.isLeaf(levels_[count_ - 1].nodes[0])) {
            NodeList& finer = next();
            const NodeList& coarser = levels_[count_ - 2];
            for (std::size_t i = 0; i < coarser.count && finer.count <= maxNodes; ++i)
                addNear(tree_.group(coarser.nodes[i]), region, finer);
            if (finer.count <= maxNodes) continue;
            --count_;
            return;
        }
    }
    NodeList& next() {
        if (count_ == levels_.size()) levels_.emplace_back();
        levels_[count_].count = 0;
        return levels_[count_++];
    }

    void write(const NodeList& list, const glm::vec3& corner, BlockEntry* entries, int each) const {
        constexpr float highest = BlockEntries::regionUnits;
        const float perVoxel = highest / (side_ + 2 * reach_),
                    margin = margin_ * perVoxel + 1.f / BlockEntries::placesPerUnit;
        for (int i = 0; i < each; ++i) {
            std::memset(&entries[i], 0, sizeof(BlockEntry));
            std::memset(entries[i].lower, BlockEntries::regionUnits, sizeof entries[i].lower);
        }
        for (std::size_t i = 0; i < list.count; ++i) {
            BlockEntry& entry = entries[i / BlockEntry::slots];
            const std::size_t slot = i % BlockEntry::slots;
            for (int k = 0; k < 3; ++k) {
                const float low = (list.lower[k][i] - corner[k]) * perVoxel - margin;
                const float high = (list.upper[k][i] - corner[k]) * perVoxel + margin;
                entry.lower[k][slot] = std::uint8_t(std::clamp(low, 0.f, highest));
                entry.upper[k][slot] = std::uint8_t(std::clamp(high + 1, 0.f, highest));
                entry.nodes[slot][k] = std::uint8_t(list.nodes[i] >> 8 * k);
            }
        }
    }

    const WideTree& tree_;
    glm::dvec3 origin_;  // of the field in the tree's frame [voxels]
    float side_;         // of a cube [voxels]
    double step_;        // the same in the tree's frame
    float reach_, margin_;
    std::vector<NodeList> levels_;
    std::size_t count_ = 0;  // of filled levels
};

// The count of entries that is sufficient for most cubes, and whether most cubes then have leaves in them.
struct Need {
    int entries;
    bool leaves;
};

Need needOf(EntryBuilder builder, const std::vector<glm::ivec3>& cubes) {
    std::vector<std::size_t> counts;
    std::size_t withLeaves = 0;
    for (std::size_t i = 0; i < cubes.size(); i += 1 + cubes.size() / samples) {
        const auto [count, leaves] = builder.count(cubes[i]);
        counts.push_back(count);
        withLeaves += leaves;
    }
    const auto place = counts.begin() + std::ptrdiff_t(usual * double(counts.size() - 1));
    std::nth_element(counts.begin(), place, counts.end());
    return {std::clamp(int((*place + BlockEntry::slots - 1) / BlockEntry::slots), 1, BlockEntries::maxEntries),
            double(withLeaves) >= usual * double(counts.size())};
}

}  // namespace

// Numbers the cubes with stored blocks group by group.
std::vector<glm::ivec3> BlockEntries::number(const FieldLayout& field) {
    const int blocksShift = shift_ - blockShift;
    const glm::ivec3 counts = (field.blocks + ((1 << blocksShift) - 1)) >> blocksShift;
    groupCounts_ = (counts + 3) >> 2;
    groups_.assign(std::size_t(groupCounts_.x) * groupCounts_.y * groupCounts_.z, CubeGroup());
    glm::ivec3 block;
    for (block.x = 0; block.x < field.blocks.x; ++block.x)
        for (block.y = 0; block.y < field.blocks.y; ++block.y)
            for (block.z = 0; block.z < field.blocks.z; ++block.z) {
                if (field.directory[field.entryOf(block)] < 0) continue;
                const glm::ivec3 cube = block >> blocksShift;
                groups_[groupOf(cube)].stored |= bitOf(cube);
            }
    std::vector<glm::ivec3> cubes;
    glm::ivec3 group;
    for (group.x = 0; group.x < groupCounts_.x; ++group.x)
        for (group.y = 0; group.y < groupCounts_.y; ++group.y)
            for (group.z = 0; group.z < groupCounts_.z; ++group.z) {
                CubeGroup& here = groups_[groupOf(4 * group)];
                here.first = std::uint32_t(cubes.size());
                for (std::uint64_t bits = here.stored; bits != 0; bits &= bits - 1) {
                    const int i = std::countr_zero(bits);
                    cubes.push_back(4 * group + glm::ivec3(i >> 4, i >> 2 & 3, i & 3));
                }
            }
    return cubes;
}

BlockEntries::BlockEntries(const FieldLayout& field, const WideTree& tree, double perMetre, float reach)
    : reach_(reach) {
    if (tree.leafCount + tree.groupCount > maxTreeNodes) return;
    extent_ = glm::dvec3(FieldFrame::side * field.blocks);
    std::vector<glm::ivec3> cubes;
    const auto builderOf = [&] { return EntryBuilder(field, tree, perMetre, reach, shift_); };
    for (shift_ = maxShift;; --shift_) {
        cubes = number(field);
        const Need need = needOf(builderOf(), cubes);
        each_ = need.entries;
        if ((each_ <= fewEntries && need.leaves) || shift_ == blockShift) break;
    }
    placesPerVoxel_ = float(placesPerUnit * regionUnits) / (float(1 << shift_) + 2 * reach);
    entries_ = LargeArray<BlockEntry>(cubes.size() * std::size_t(each_));
    const EntryBuilder builder = builderOf();
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, cubes.size(), cubesPerTask), [&](const auto& range) {
        EntryBuilder own(builder);
        for (std::size_t i = range.begin(); i < range.end(); ++i)
            own.make(cubes[i], entries_.data() + i * std::size_t(each_), each_);
    });
}

}  // namespace bilayer::detail
