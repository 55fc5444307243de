// Questions to the hierarchy over the triangles, asked with SIMD: which nodes come near a box of voxels, and how far
// each voxel of a block is from its nearest triangle. Nothing is asked from the root: a list of nodes is narrowed from
// large boxes of voxels to small ones, and a voxel looks only at what is left of it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include "sdf/bvh/wide_tree.h"
#include "sdf/leaf/sign_propagation.h"

namespace bilayer::detail {

/// Nodes of a tree with copies of their boxes, in the tree's frame.
struct NodeList {
    std::vector<float> lower[3], upper[3];  ///< longer than `count` by a vector at least [voxels]
    std::vector<std::uint32_t> nodes;
    std::size_t count = 0;

    void makeRoom(std::size_t more);
};

/// The list that holds all of a tree.
NodeList wholeTree(const WideTree& tree);

/// A box of voxels in the tree's frame; `upper` is its last voxel.
struct VoxelBox {
    glm::vec3 lower, upper;
};

/// Those nodes that come within `reach` of the voxels; groups with a side above `largest` are replaced by what is in
/// them [voxels]. `to` is overwritten.
void narrow(const WideTree& tree, const NodeList& from, const VoxelBox& voxels, float reach, float largest,
            NodeList& to);

/// What is known of the voxels of a block; memory is used again from block to block.
struct BlockAnswer {
    /// `farAway` beyond the reach; a row more can be read [voxels].
    alignas(64) float distances[blockVoxels + blockSide]{};
    std::int32_t triangles[blockVoxels];  ///< the nearest ones, -1 beyond the reach
    BlockMask known;                      ///< voxels within the reach
    BlockMask far, mid;                   ///< of these, those beyond `farFrom` and `midFrom` (links.h)
    BlockSides sides;                     ///< what faces tell, where they are asked for
    BlockSides nearest;                   ///< what the nearest one alone tells: a guess where others are as near

    /// A leaf that was looked at for the current voxel, and what was found there.
    struct Visit {
        alignas(64) float distance2[treeWidth];
        float height[treeWidth];  ///< over the triangles; 0 beside them
        std::uint32_t leaf;
    };
    std::vector<Visit> visits;     ///< scratch
    std::uint32_t lastWinner = 0;  ///< scratch: a leaf to begin with
    NodeList lists[3];             ///< scratch: of the block, of its eighths, of theirs
};

/// Finds the distances of the voxels of a block, and the sides of those whose closest point lies inside a face.
/// @param list    nodes, all that come within the reach of the block
/// @param origin  the block's first voxel in the tree's frame
/// @param sign    whether to find sides
void answerBlock(const WideTree& tree, const NodeList& list, const glm::vec3& origin, float reach, bool sign,
                 BlockAnswer& answer);

}  // namespace bilayer::detail
