#include "collider/block_entries.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <bit>
#include <limits>

namespace bilayer {
namespace {

/// What the frames of field and tree may differ by [voxels].
constexpr double frameRounding = 1e-2;
constexpr std::size_t grain = 256;  // entries of the directory a task

struct Region {
    glm::vec3 lower, upper;
    float reach2;
};

// Nodes with their boxes; some may be more than an entry holds.
struct Nodes {
    std::size_t count = 0;
    EntryGroup group;

    void add(const float (&lower)[3], const float (&upper)[3], std::uint32_t node) {
        for (int k = 0; k < 3; ++k) {
            group.lower[k][count] = lower[k];
            group.upper[k][count] = upper[k];
        }
        group.nodes[count++] = node;
    }
    void add(const EntryGroup& from, std::size_t i) {
        add({from.lower[0][i], from.lower[1][i], from.lower[2][i]},
            {from.upper[0][i], from.upper[1][i], from.upper[2][i]}, from.nodes[i]);
    }
};

// Those boxes of a group that come near, bit by bit.
template <class Group>
unsigned nearBoxes(const Group& group, const Region& region) {
    float sums[treeWidth] = {};
    for (int k = 0; k < 3; ++k)
        for (int i = 0; i < treeWidth; ++i) {
            const float gap = std::max({0.f, group.lower[k][i] - region.upper[k], region.lower[k] - group.upper[k][i]});
            sums[i] += gap * gap;
        }
    unsigned near = 0;
    for (int i = 0; i < treeWidth; ++i) near |= unsigned(sums[i] <= region.reach2) << i;
    return near;
}

void fillUp(Nodes& nodes) {
    constexpr float infinity = std::numeric_limits<float>::infinity();
    while (nodes.count < treeWidth) nodes.add({infinity, infinity, infinity}, {-infinity, -infinity, -infinity}, 0);
}

Nodes wholeTree(const WideTree& tree) {
    constexpr float huge = std::numeric_limits<float>::max();
    Nodes nodes;
    nodes.add({-huge, -huge, -huge}, {huge, huge, huge}, tree.root());
    fillUp(nodes);
    return nodes;
}

// Drops what is not near the region, then opens groups, the largest first, as long as there is room.
Nodes narrowed(const WideTree& tree, const Nodes& from, const Region& region) {
    Nodes nodes;
    const unsigned kept = nearBoxes(from.group, region);
    for (std::size_t i = 0; i < treeWidth; ++i)
        if (kept >> i & 1) nodes.add(from.group, i);
    std::uint32_t below = ~0u;  // groups are numbered from the finest to the coarsest
    for (;;) {
        std::size_t largest = treeWidth;
        for (std::size_t i = 0; i < nodes.count; ++i) {
            const std::uint32_t node = nodes.group.nodes[i];
            if (node < below && !tree.isLeaf(node) && (largest == treeWidth || node > nodes.group.nodes[largest]))
                largest = i;
        }
        if (largest == treeWidth) break;
        below = nodes.group.nodes[largest];
        const BoxGroup& group = tree.group(below);
        const unsigned near = nearBoxes(group, region);
        if (nodes.count - 1 + std::size_t(std::popcount(near)) > treeWidth) continue;
        Nodes next;
        for (std::size_t i = 0; i < nodes.count; ++i)
            if (i != largest) next.add(nodes.group, i);
        for (int i = 0; i < treeWidth; ++i)
            if (near >> i & 1)
                next.add({group.lower[0][i], group.lower[1][i], group.lower[2][i]},
                         {group.upper[0][i], group.upper[1][i], group.upper[2][i]},
                         group.firstChild + std::uint32_t(i));
        nodes = next;
    }
    fillUp(nodes);
    return nodes;
}

}  // namespace

BlockEntries::BlockEntries(const FieldLayout& field, const WideTree& tree, double perMetre, float reach) {
    const std::size_t allowed = tree.leafCount * sizeof(WideLeaf), bytes = field.stored * sizeof(EntryGroup);
    partsPerSide_ = 8 * bytes <= allowed ? 2 : bytes <= allowed ? 1 : 0;
    if (partsPerSide_ == 0) return;
    const int parts = partsPerSide_ * partsPerSide_ * partsPerSide_;
    groups_ = LargeArray<EntryGroup>(field.stored * std::size_t(parts));
    const Nodes all = wholeTree(tree);
    const auto regionOf = [&](const glm::ivec3& voxel, int side) {
        const glm::dvec3 lower = (field.origin + field.voxel * glm::dvec3(voxel)) * perMetre - glm::dvec3(tree.base);
        return Region{glm::vec3(lower - frameRounding), glm::vec3(lower + (side + frameRounding)), reach * reach};
    };
    const auto fill = [&](const glm::ivec3& voxel, EntryGroup* to) {
        const Nodes ofBlock = narrowed(tree, all, regionOf(voxel, FieldFrame::side));
        to[0] = ofBlock.group;
        if (parts == 1) return;
        constexpr int half = FieldFrame::side / 2;
        for (int i = 0; i < parts; ++i) {
            const glm::ivec3 part(i >> 2, i >> 1 & 1, i & 1);
            to[i] = narrowed(tree, ofBlock, regionOf(voxel + half * part, half)).group;
        }
    };
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, field.entries(), grain), [&](const auto& range) {
        for (std::size_t i = range.begin(); i < range.end(); ++i) {
            const std::int32_t number = field.directory[i];
            if (number < 0) continue;
            const int z = int(i % std::size_t(field.blocks.z)), xy = int(i / std::size_t(field.blocks.z));
            const glm::ivec3 block(xy / field.blocks.y, xy % field.blocks.y, z);
            fill(FieldFrame::side * block, groups_.data() + std::size_t(number) * std::size_t(parts));
        }
    });
}

}  // namespace bilayer
