// A bounding hierarchy over the triangles of a mesh, made for questions about the nearest triangle: triangles sorted
// along Hilbert's curve, eight to a leaf, eight boxes to a group, and so on upward, with no pointers and no choices
// that cost time. Long triangles are halved first, until they are as small as a block: their boxes fit well and single
// precision is enough for all that is measured from a triangle's own cell.
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

/// Eight triangles, each in a frame of its own: corner A is its origin, x runs from A to B, z along the normal, and
/// C = (c.x, c.y) has y >= 0. Lengths in voxels. Places that are left over repeat a triangle.
struct WideLeaf {
    alignas(64) float cell[3][treeWidth];  ///< A rounded down to whole voxels, in the tree's frame
    float corner[3][treeWidth];            ///< A from there
    float normal[3][treeWidth];            ///< the direction of z
    float along[3][treeWidth];             ///< the direction of x
    float lengthAB[treeWidth];
    float directionBC[2][treeWidth], lengthBC[treeWidth];
    float directionAC[2][treeWidth], lengthAC[treeWidth];
    std::uint32_t triangles[treeWidth];  ///< indices into Mesh::triangles
};

/// The triangles of a mesh under a tree of boxes [voxels].
struct WideTree : BoxTree {
    glm::ivec3 base{0};  ///< index coordinates of the origin of the tree's frame, multiples of 8
    glm::ivec3 size{0};  ///< a box of this size from `base` holds the mesh [voxels]
    LargeArray<WideLeaf> leaves;
};

/// How triangles are put into an order, from which the hierarchy follows.
enum class TreeOrder {
    hilbert,  ///< along Hilbert's curve: quick to make
    split,    ///< in halves along the longest side, over and over: boxes overlap less
};

/// What a hierarchy is made for.
struct TreeShape {
    TreeOrder order = TreeOrder::hilbert;
    /// Triangles with a longer edge are halved: around them, floats are exact to 1.2e-7 of it [voxels].
    double longestEdge = 8;
};

/// Builds the hierarchy of a valid mesh on all cores; the result does not depend on their number.
/// @param voxelSize  [m]
/// @param progress   polled, unless null
/// Throws std::invalid_argument if the mesh is longer than 2^23 voxels or has more than 2^28 triangles and parts of
/// halved ones.
WideTree makeWideTree(const Mesh& mesh, float voxelSize, Progress* progress = nullptr, const TreeShape& shape = {});

}  // namespace bilayer::detail
