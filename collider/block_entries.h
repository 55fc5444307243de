// Where searches for what is nearest to a point in the band begin: for each part of a stored block, the few nodes of
// the hierarchy that come within the band's reach of it. The levels above them are never looked at.
#pragma once

#include <hwy/cache_control.h>

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>

#include "sdf/field_layout.h"
#include "sdf/large_array.h"
#include "sdf/wide_tree.h"

namespace bilayer {

/// Nodes of a tree with their boxes, in the tree's frame; a box that is left over is empty: infinitely far away.
struct EntryGroup {
    alignas(64) float lower[3][treeWidth];
    float upper[3][treeWidth];
    std::uint32_t nodes[treeWidth];

    /// Asks for its memory ahead of its use.
    void fetch() const {
        for (const void* line : {&lower[0], &lower[2], &upper[1]}) hwy::Prefetch(static_cast<const char*>(line));
        hwy::Prefetch(&nodes);
    }
};
static_assert(sizeof(EntryGroup) == 256, "four cache lines");

/// Entries for blocks, or for their eighths where they take no more memory than the hierarchy; none at all where those
/// for blocks would.
class BlockEntries {
  public:
    BlockEntries() = default;

    /// @param perMetre  voxels, of the tree
    /// @param reach     of the searches that begin here [voxels]
    BlockEntries(const FieldLayout& field, const WideTree& tree, double perMetre, float reach);

    /// Of a point in a stored block; null if there are none.
    /// @param block    its number in the layout
    /// @param inBlock  the point's voxel
    const EntryGroup* of(std::int32_t block, const glm::ivec3& inBlock) const {
        if (partsPerSide_ == 0) return nullptr;
        const glm::ivec3 part = inBlock * partsPerSide_ / FieldFrame::side;
        return &groups_[(std::size_t(block) * partsPerSide_ + part.x) * partsPerSide_ * partsPerSide_ +
                        std::size_t(part.y * partsPerSide_ + part.z)];
    }

    std::size_t memoryBytes() const { return groups_.bytes(); }

  private:
    int partsPerSide_ = 0;
    LargeArray<EntryGroup> groups_;
};

}  // namespace bilayer
