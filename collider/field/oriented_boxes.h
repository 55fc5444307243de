// Boxes around the nodes of a WideTree that lie as the surface lies: those of a group share a frame that is turned
// along the normals of its triangles. A piece of a smooth surface is flat in such a box, so that the box is hardly
// nearer to a point than the piece itself; boxes along the axes stand up from slanted pieces, and searches open them
// for nothing. After S. Gottschalk, M. C. Lin, D. Manocha, "OBBTree", SIGGRAPH 1996, 171-180.
#pragma once

#include <cstddef>
#include <cstdint>

#include "sdf/base/large_array.h"
#include "sdf/bvh/wide_tree.h"

namespace bilayer::detail {

/// The boxes of eight leaves or of eight groups in a frame of their own [voxels]; one that is left over is empty:
/// infinitely far away.
struct TurnedGroup {
    alignas(64) float lower[3][treeWidth];
    float upper[3][treeWidth];
    float axes[3][3];          ///< of the frame, as seen from the tree's
    float origin[3];           ///< of the frame in the tree's; whole voxels
    std::uint32_t firstChild;  ///< the node of the first box; the others follow
};
static_assert(sizeof(TurnedGroup) == 256, "four cache lines");

/// Groups in the order of the tree's; `groupCount` of them.
LargeArray<TurnedGroup> makeTurnedGroups(const WideTree& tree);

}  // namespace bilayer::detail
