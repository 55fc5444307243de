#include "collider/block_entries.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <vector>

namespace bilayer {
namespace {

/// What the frames of field and tree may differ by [voxels], and floats in the latter from what they stand for, as a
/// part of its size.
constexpr float frameRounding = 1e-2f, placeRounding = 3e-7f;
/// As many nodes fit into a block's entries.
constexpr std::size_t mostNodes = BlockEntries::most * BlockEntry::slots;
/// Entries have room for the nodes of this part of the blocks; others make do with a coarser level. So many blocks are
/// looked at to tell.
constexpr double usual = 0.9;
constexpr std::size_t samples = 512;
constexpr std::uint32_t mostTreeNodes = 1 << 24;
constexpr std::size_t grain = 256;  // blocks a task

struct Region {
    glm::vec3 lower, upper;
    float reach2;
};

// Nodes of one level with their boxes, in the tree's frame.
class Nodes {
  public:
    void clear() { size_ = 0; }
    std::size_t size() const { return size_; }
    std::uint32_t node(std::size_t i) const { return nodes_[i]; }
    float lower(int k, std::size_t i) const { return lower_[k][i]; }
    float upper(int k, std::size_t i) const { return upper_[k][i]; }

    // Adds those of eight boxes that come near a region.
    template <class NodeOf>
    void addNear(const float* const (&lower)[3], const float* const (&upper)[3], int count, NodeOf nodeOf,
                 const Region& region) {
        float sums[treeWidth] = {};
        for (int k = 0; k < 3; ++k)
            for (int i = 0; i < treeWidth; ++i) {
                const float gap = std::max(std::max(0.f, lower[k][i] - region.upper[k]), region.lower[k] - upper[k][i]);
                sums[i] += gap * gap;
            }
        reserve(size_ + treeWidth);
        for (int i = 0; i < count; ++i) {
            for (int k = 0; k < 3; ++k) {
                lower_[k][size_] = lower[k][i];
                upper_[k][size_] = upper[k][i];
            }
            nodes_[size_] = nodeOf(i);
            size_ += sums[i] <= region.reach2;
        }
    }

    // Adds those children of a group that come near a region.
    void addNear(const BoxGroup& group, const Region& region) {
        addNear(
            {group.lower[0], group.lower[1], group.lower[2]}, {group.upper[0], group.upper[1], group.upper[2]},
            treeWidth, [&](int i) { return group.firstChild + std::uint32_t(i); }, region);
    }

    // Takes over those nodes that come near a region.
    void addNear(const Nodes& from, const Region& region) {
        for (std::size_t i = 0; i < from.size_; i += treeWidth)
            addNear(
                {&from.lower_[0][i], &from.lower_[1][i], &from.lower_[2][i]},
                {&from.upper_[0][i], &from.upper_[1][i], &from.upper_[2][i]},
                int(std::min<std::size_t>(treeWidth, from.size_ - i)),
                [&](int k) { return from.nodes_[i + std::size_t(k)]; }, region);
    }

  private:
    // Whole vectors may be read and written.
    void reserve(std::size_t size) {
        if (size + treeWidth <= nodes_.size()) return;
        const std::size_t room = 2 * (size + treeWidth);
        for (int k = 0; k < 3; ++k) lower_[k].resize(room), upper_[k].resize(room);
        nodes_.resize(room);
    }

    std::size_t size_ = 0;
    std::vector<float> lower_[3], upper_[3];
    std::vector<std::uint32_t> nodes_;
};

// Makes the entries of one block after another.
class Maker {
  public:
    Maker(const FieldLayout& field, const WideTree& tree, double perMetre, float reach)
        : tree_(tree),
          origin_(field.origin * perMetre - glm::dvec3(tree.base)),
          side_(double(FieldFrame::side) * field.voxel * perMetre),
          reach_(reach),
          room_(frameRounding + placeRounding * float(std::max({tree.size.x, tree.size.y, tree.size.z}))) {}

    // How many nodes of the finest level that can have room in entries come near a block.
    std::size_t count(const glm::ivec3& block) {
        descend(block);
        return levels_[count_ - 1].size();
    }

    void make(const glm::ivec3& block, BlockEntry* to, int each) {
        descend(block);
        std::size_t level = count_ - 1;
        while (levels_[level].size() > std::size_t(each * BlockEntry::slots)) --level;
        write(levels_[level], lowerOf(block) - reach_, to, each);
    }

  private:
    glm::vec3 lowerOf(const glm::ivec3& block) const { return glm::vec3(origin_ + side_ * glm::dvec3(block)); }

    // The nodes near a block, level by level from the root, as far as they are not too many.
    void descend(const glm::ivec3& block) {
        const glm::vec3 lower = lowerOf(block);
        const Region region{lower - room_, lower + float(FieldFrame::side) + room_, reach_ * reach_};
        count_ = 0;
        next().addNear(tree_.group(tree_.root()), region);
        while (levels_[count_ - 1].size() > 0 && !tree_.isLeaf(levels_[count_ - 1].node(0))) {
            Nodes& finer = next();
            const Nodes& coarser = levels_[count_ - 2];
            for (std::size_t i = 0; i < coarser.size() && finer.size() <= mostNodes; ++i)
                finer.addNear(tree_.group(coarser.node(i)), region);
            if (finer.size() <= mostNodes) continue;
            --count_;
            return;
        }
    }
    Nodes& next() {
        if (count_ == levels_.size()) levels_.emplace_back();
        levels_[count_].clear();
        return levels_[count_++];
    }

    void write(const Nodes& nodes, const glm::vec3& corner, BlockEntry* entries, int each) const {
        constexpr float most = BlockEntries::regionUnits;
        const float perVoxel = most / (float(FieldFrame::side) + 2 * reach_),
                    room = room_ * perVoxel + 1.f / BlockEntries::placesPerUnit;
        for (int i = 0; i < each; ++i) {
            std::memset(&entries[i], 0, sizeof(BlockEntry));
            std::memset(entries[i].lower, BlockEntries::regionUnits, sizeof entries[i].lower);
        }
        for (std::size_t i = 0; i < nodes.size(); ++i) {
            BlockEntry& entry = entries[i / BlockEntry::slots];
            const std::size_t slot = i % BlockEntry::slots;
            for (int k = 0; k < 3; ++k) {
                const float low = (nodes.lower(k, i) - corner[k]) * perVoxel - room;
                const float high = (nodes.upper(k, i) - corner[k]) * perVoxel + room;
                entry.lower[k][slot] = std::uint8_t(std::clamp(low, 0.f, most));
                entry.upper[k][slot] = std::uint8_t(std::clamp(high + 1, 0.f, most));
                entry.nodes[slot][k] = std::uint8_t(nodes.node(i) >> 8 * k);
            }
        }
    }

    const WideTree& tree_;
    glm::dvec3 origin_;  // of the field in the tree's frame [voxels]
    double side_;        // of a block
    float reach_, room_;
    std::vector<Nodes> levels_;
    std::size_t count_ = 0;  // of levels that are filled
};

// Entries that are enough for most blocks.
int enough(Maker maker, const std::vector<glm::ivec3>& blocks) {
    std::vector<std::size_t> counts;
    for (std::size_t i = 0; i < blocks.size(); i += 1 + blocks.size() / samples)
        counts.push_back(maker.count(blocks[i]));
    const auto place = counts.begin() + std::ptrdiff_t(usual * double(counts.size() - 1));
    std::nth_element(counts.begin(), place, counts.end());
    return std::clamp(int((*place + BlockEntry::slots - 1) / BlockEntry::slots), 1, BlockEntries::most);
}

}  // namespace

// Numbers the stored blocks tile by tile.
std::vector<glm::ivec3> BlockEntries::number(const FieldLayout& field) {
    tileCounts_ = (field.blocks + 3) >> 2;
    tiles_.resize(std::size_t(tileCounts_.x) * tileCounts_.y * tileCounts_.z);
    glm::ivec3 block;
    for (block.x = 0; block.x < field.blocks.x; ++block.x)
        for (block.y = 0; block.y < field.blocks.y; ++block.y)
            for (block.z = 0; block.z < field.blocks.z; ++block.z)
                if (field.directory[field.entryOf(block)] >= 0) tiles_[tileOf(block)].stored |= bitOf(block);
    std::vector<glm::ivec3> blocks;
    glm::ivec3 tile;
    for (tile.x = 0; tile.x < tileCounts_.x; ++tile.x)
        for (tile.y = 0; tile.y < tileCounts_.y; ++tile.y)
            for (tile.z = 0; tile.z < tileCounts_.z; ++tile.z) {
                Tile& here = tiles_[tileOf(4 * tile)];
                here.first = std::uint32_t(blocks.size());
                for (std::uint64_t bits = here.stored; bits != 0; bits &= bits - 1) {
                    const int i = std::countr_zero(bits);
                    blocks.push_back(4 * tile + glm::ivec3(i >> 4, i >> 2 & 3, i & 3));
                }
            }
    return blocks;
}

BlockEntries::BlockEntries(const FieldLayout& field, const WideTree& tree, double perMetre, float reach)
    : reach_(reach), placesPerVoxel_(float(placesPerUnit * regionUnits) / (float(FieldFrame::side) + 2 * reach)) {
    if (tree.leafCount + tree.groupCount > mostTreeNodes) return;
    const std::vector<glm::ivec3> blocks = number(field);
    extent_ = glm::dvec3(FieldFrame::side * field.blocks);
    const Maker maker(field, tree, perMetre, reach);
    each_ = enough(maker, blocks);
    entries_ = LargeArray<BlockEntry>(blocks.size() * std::size_t(each_));
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, blocks.size(), grain), [&](const auto& range) {
        Maker own(maker);
        for (std::size_t i = range.begin(); i < range.end(); ++i)
            own.make(blocks[i], entries_.data() + i * std::size_t(each_), each_);
    });
}

}  // namespace bilayer
