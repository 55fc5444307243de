// SPDX-License-Identifier: Apache-2.0
// Oriented bounding boxes of a WideTree's nodes. The boxes of a group share a frame that is rotated along the normals
// of its triangles. Pieces of a smooth surface are flat in such boxes, so the distance bounds are tight. Axis-aligned
// boxes of slanted pieces are loose, and searches would open them in vain. After S. Gottschalk, M. C. Lin, D. Manocha,
// "OBBTree", SIGGRAPH 1996, 171-180.
// Tested by tests/collider/field_closest.cpp through Field::closest().
#pragma once

#include <cstddef>
#include <cstdint>

#include "sdf/base/large_array.h"
#include "sdf/bvh/wide_tree.h"

namespace bilayer::detail {

/// The boxes of eight leaves or eight groups in a common frame [voxels]. Unused boxes are empty and infinitely far
/// away.
struct OrientedBoxes {
    alignas(64) float lower[3][treeWidth];
    float upper[3][treeWidth];
    float axes[3][3];          ///< of the frame, in the tree's frame
    float origin[3];           ///< of the frame in the tree's frame; whole voxels
    std::uint32_t firstChild;  ///< the node of the first box; the others follow
};
static_assert(sizeof(OrientedBoxes) == 256, "four cache lines");

/// The groups in the order of the tree's groups; `groupCount` of them.
LargeArray<OrientedBoxes> makeOrientedBoxes(const WideTree& tree);

}  // namespace bilayer::detail
