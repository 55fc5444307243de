// SPDX-License-Identifier: Apache-2.0
// A bounding volume hierarchy over the triangles of a mesh for nearest-triangle queries. Triangles are sorted in
// Hilbert order. A leaf holds eight triangles and a group eight boxes. Nodes have no pointers, and traversal has no
// expensive branches. Long triangles are halved first until they are as small as a block. Their boxes are then tight,
// and single precision suffices for distances relative to a triangle's own cell.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include <bilayer/sdf/mesh.h>
#include "sdf/base/large_array.h"
#include "sdf/bvh/box_tree.h"

namespace bilayer::detail {

class Progress;

/// Eight triangles, each in its own frame: corner A is the origin, x points from A to B, z along the normal, and C =
/// (c.x, c.y) has y >= 0. Lengths are in voxels. Unused slots repeat a triangle.
struct WideLeaf {
    alignas(64) float cell[3][treeWidth];  ///< A rounded down to whole voxels, in the tree's frame
    float corner[3][treeWidth];            ///< A relative to `cell`
    float normal[3][treeWidth];            ///< direction of z
    float along[3][treeWidth];             ///< direction of x
    float lengthAB[treeWidth];
    float directionBC[2][treeWidth], lengthBC[treeWidth];
    float directionAC[2][treeWidth], lengthAC[treeWidth];
    std::uint32_t triangles[treeWidth];  ///< indices into Mesh::triangles
};

/// A tree of boxes with the triangles of its leaves [voxels].
struct WideTree : BoxTree {
    glm::ivec3 base{0};  ///< index coordinates of the origin of the tree's frame, multiples of 8
    glm::ivec3 size{0};  ///< the box of this size at `base` contains the mesh [voxels]
    LargeArray<WideLeaf> leaves;
};

/// The order of triangles, which determines the hierarchy.
enum class TreeOrder {
    hilbert,  ///< Hilbert order: fast to build
    split,    ///< recursive halves along the longest axis: boxes overlap less
};

/// How to build a hierarchy.
struct TreeShape {
    TreeOrder order = TreeOrder::hilbert;
    /// Triangles with a longer edge are halved. Single-precision coordinates are exact to 1.2e-7 of this length
    /// [voxels].
    double longestEdge = 8;
};

/// Builds the hierarchy of a valid mesh on all cores. The result does not depend on the count of threads.
/// @param voxelSize  [m]
/// @param progress   polled, unless null
/// Throws std::invalid_argument if the mesh is longer than 2^23 voxels, or has more than 2^28 triangles including the
/// parts of halved ones.
WideTree makeWideTree(const Mesh& mesh, float voxelSize, Progress* progress = nullptr, const TreeShape& shape = {});

}  // namespace bilayer::detail
