// SPDX-License-Identifier: Apache-2.0
// Lists of candidate nodes of a triangle hierarchy. A query does not start at the root: a list is narrowed from large
// boxes of voxels to small ones.
// Tested by tests/sdf/wide_tree.cpp.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include "sdf/bvh/wide_tree.h"

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

}  // namespace bilayer::detail
