// SIMD queries of the triangle hierarchy: which nodes come near a box of voxels, and how far each voxel of a block is
// from its nearest triangle. Queries do not start at the root. A list of candidate nodes is narrowed from large boxes
// of voxels to small ones, and a voxel tests only the remaining candidates.
// Tested by tests/sdf/wide_tree.cpp.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include "sdf/bvh/wide_tree.h"
#include "sdf/leaf/sign_propagation.h"

namespace bilayer::detail {

/// A list of nodes of a tree with copies of their boxes, in the tree's frame.
struct NodeList {
    std::vector<float> lower[3], upper[3];  ///< padded beyond `count` by at least one vector [voxels]
    std::vector<std::uint32_t> nodes;
    std::size_t count = 0;

    void makeRoom(std::size_t more);
};

/// Returns the list that covers a whole tree: its root.
NodeList wholeTree(const WideTree& tree);

/// A box of voxels in the tree's frame. `upper` is its last voxel.
struct VoxelBox {
    glm::vec3 lower, upper;
};

/// Writes to `to` the nodes that come within `reach` of the voxels. Groups with a side longer than `largest` are
/// replaced by their children [voxels]. Overwrites `to`.
void narrow(const WideTree& tree, const NodeList& from, const VoxelBox& voxels, float reach, float largest,
            NodeList& to);

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
