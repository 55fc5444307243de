// SPDX-License-Identifier: Apache-2.0
// SIMD queries of the triangle hierarchy: how far each voxel of a block is from its nearest triangle, and on which side
// of it. A voxel tests only the candidates that remain after narrowing (node_list.h).
// Tested by tests/sdf/wide_tree.cpp.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include "sdf/bvh/node_list.h"
#include "sdf/bvh/wide_tree.h"
#include "sdf/leaf/sign_propagation.h"

namespace bilayer::detail {

/// Query results for the voxels of a block. The memory is reused from block to block.
struct BlockAnswer {
    /// Distances; `farAway` beyond the reach. One more row can be read [voxels].
    alignas(64) float distances[blockVoxels + blockSide]{};
    std::int32_t triangles[blockVoxels];  ///< the nearest triangles; -1 beyond the reach
    BlockMask known;                      ///< voxels within the reach
    BlockMask far, mid;  ///< subsets of `known`: voxels beyond `farFrom` and `midFrom` (sign_propagation.h)
    BlockSides sides;    ///< sides of the surface by faces, if requested
    BlockSides nearest;  ///< sides by the nearest triangle alone: a guess where others are equally near

    /// A leaf that was tested for the current voxel, with its results.
    struct Visit {
        alignas(64) float distance2[treeWidth];
        float height[treeWidth];  ///< above the triangles; 0 for projections outside of them
        std::uint32_t leaf;
    };
    std::vector<Visit> visits;     ///< scratch memory
    std::uint32_t lastWinner = 0;  ///< scratch: the leaf to test first
    NodeList lists[3];             ///< scratch: candidates of the block, of an octant, and of an octant of that
};

/// Computes the distances of the voxels of a block, and the sides of voxels whose closest point is interior to a face.
/// @param list    all nodes that come within the reach of the block
/// @param origin  the block's first voxel in the tree's frame
/// @param sign    whether to compute sides
void answerBlock(const WideTree& tree, const NodeList& list, const glm::vec3& origin, float reach, bool sign,
                 BlockAnswer& answer);

}  // namespace bilayer::detail
