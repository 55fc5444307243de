// SPDX-License-Identifier: Apache-2.0
// Entry points of closest-point searches in the band. A cube is a stored block, or a group of blocks where triangles
// are large compared with voxels. For each cube, the entries hold the hierarchy's nodes within the band's reach; they
// are leaves where those are few enough. Searches thus skip the levels above, and the field's distances.
// Tested by tests/collider/field_closest.cpp through Field::closest().
#pragma once

#include <hwy/cache_control.h>

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <glm/common.hpp>
#include <glm/vec3.hpp>
#include <vector>

#include "collider/field/layout/field_layout.h"
#include "sdf/base/large_array.h"
#include "sdf/bvh/wide_tree.h"

namespace bilayer::detail {

/// Seven nodes of a tree with quantised boxes. The unit is 1/255 of the cube's region: the cube expanded by the reach.
/// Boxes of unused slots are empty and out of reach. The size is one cache line, since cache misses dominate the search
/// time.
struct BlockEntry {
    static constexpr int slots = 7;

    alignas(64) std::uint8_t lower[3][slots];
    std::uint8_t upper[3][slots];
    std::uint8_t nodes[slots][3];  ///< lowest byte first

    std::uint32_t node(int slot) const {
        return nodes[slot][0] | std::uint32_t(nodes[slot][1]) << 8 | std::uint32_t(nodes[slot][2]) << 16;
    }
};
static_assert(sizeof(BlockEntry) == 64, "a cache line");

/// A point in the region of a cube.
struct EntryPlace {
    const BlockEntry* entries = nullptr;         ///< of the cube; null: the point is in no cube with stored blocks
    int count = 0;                               ///< of entries
    std::array<std::int32_t, 3> place{0, 0, 0};  ///< from the region's lower corner [1/8 of the boxes' unit]
    float perVoxel = 0;                          ///< units of `place` per voxel

    /// Prefetches the entries.
    void fetch() const {
        for (int i = 0; i < count; ++i) hwy::Prefetch(&entries[i]);
    }
};

/// Entries for all cubes with stored blocks, with the same count for each. Empty for a tree of more than 2^24 nodes.
class BlockEntries {
  public:
    static constexpr int placesPerUnit = 8, regionUnits = 255;
    static constexpr int maxEntries = 6;  ///< max count of entries per cube

    BlockEntries() = default;

    /// @param perMetre  voxels per metre, of the tree
    /// @param reach     of the searches that start here [voxels]
    BlockEntries(const FieldLayout& field, const WideTree& tree, double perMetre, float reach);

    /// The entries for a point in the field's frame [voxels].
    EntryPlace at(const glm::dvec3& local) const {
        const glm::dvec3& size = extent_;
        const bool within =
            local.x >= 0 && local.y >= 0 && local.z >= 0 && local.x < size.x && local.y < size.y && local.z < size.z;
        if (!within) return {};
        const glm::ivec3 cube = glm::ivec3(local) >> shift_;
        const CubeGroup& group = groups_[groupOf(cube)];
        const std::uint64_t bit = bitOf(cube);
        if (!(group.stored & bit)) return {};
        const std::size_t index = group.first + std::size_t(std::popcount(group.stored & (bit - 1)));
        const glm::ivec3 place((glm::vec3(local - glm::dvec3(cube << shift_)) + reach_) * placesPerVoxel_ + 0.5f);
        return {&entries_[index * each_], each_, {place.x, place.y, place.z}, placesPerVoxel_};
    }

    float reach() const { return reach_; }  ///< [voxels]
    std::size_t memoryBytes() const { return entries_.bytes() + groups_.size() * sizeof(CubeGroup); }

  private:
    /// A group of 4^3 cubes: a bit mask of those with stored blocks, and the count of such cubes before the group. It
    /// is small compared with the field's directory.
    struct CubeGroup {
        std::uint64_t stored = 0;
        std::uint32_t first = 0;
    };

    std::size_t groupOf(const glm::ivec3& cube) const {
        const glm::ivec3 group = cube >> 2;
        return (std::size_t(group.x) * groupCounts_.y + group.y) * groupCounts_.z + group.z;
    }
    static std::uint64_t bitOf(const glm::ivec3& cube) {
        return std::uint64_t(1) << ((cube.x & 3) << 4 | (cube.y & 3) << 2 | (cube.z & 3));
    }
    std::vector<glm::ivec3> number(const FieldLayout& field);

    int each_ = 1;
    int shift_ = 0;  ///< log2 of a cube's side [voxels]
    float reach_ = 0, placesPerVoxel_ = 0;
    glm::dvec3 extent_{0};  ///< of the field [voxels]
    glm::ivec3 groupCounts_{0};
    std::vector<CubeGroup> groups_;
    LargeArray<BlockEntry> entries_;
};

}  // namespace bilayer::detail
