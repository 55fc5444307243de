// SPDX-License-Identifier: Apache-2.0
// A bounding volume hierarchy with eight children per node. It is implicit: nodes have no pointers, and traversal has
// no expensive branches. Leaves are stored in Hilbert order. The user of the tree defines what a leaf holds, in most
// cases eight triangles.
// Tested by tests/sdf/triangle_tree.cpp through TriangleTree.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include "sdf/base/large_array.h"

namespace bilayer::detail {

class Progress;

inline constexpr int treeWidth = 8;  ///< triangles per leaf and boxes per group: one vector of floats

/// Max nodes that a search keeps open, where opening a group adds at most seven: eleven levels of groups hold all nodes
/// that 32 bits can number.
inline constexpr std::size_t maxOpenNodes = (treeWidth - 1) * 11 + 1;

/// The boxes of eight leaves or of eight groups. Unused boxes are empty, that is, infinitely far away.
struct BoxGroup {
    alignas(64) float lower[3][treeWidth];
    float upper[3][treeWidth];
    std::uint32_t firstChild;  ///< the node of the first box; the nodes of the other boxes follow
};

/// Nodes are numbered: first the leaves, then the groups from the finest to the coarsest level. The last node is the
/// root.
struct BoxTree {
    std::uint32_t leafCount = 0, groupCount = 0;
    LargeArray<BoxGroup> groups;

    bool isLeaf(std::uint32_t node) const { return node < leafCount; }
    const BoxGroup& group(std::uint32_t node) const { return groups[node - leafCount]; }
    std::uint32_t root() const { return leafCount + groupCount - 1; }

    /// Allocates the groups for this count of leaves, at least one.
    void makeRoom(std::size_t leaves);
    /// Sets the box of a leaf. Any thread may call this for any leaf, once per leaf.
    void setLeafBox(std::size_t leaf, const glm::vec3& lower, const glm::vec3& upper);
    /// Computes the boxes of groups bottom-up from those of the leaves. Throws Cancelled.
    void joinBoxes(Progress* progress);
};

/// Cells along each axis of the cube that the Hilbert curve fills.
inline constexpr std::uint32_t curveCells = 1 << 12;
/// A key of 64 bits holds a position along the curve and the index of the item there.
inline constexpr std::size_t maxOnCurve = std::size_t(1) << 28;
inline constexpr std::uint64_t curveIndexMask = maxOnCurve - 1;

/// Cell coordinates, stored as arrays per axis so that the compiler can vectorise.
struct CurveCells {
    static constexpr std::size_t capacity = 64;
    std::uint32_t x[3][capacity];
};

/// Writes the keys of the items in the first `count` cells, whose indices start at `first`. Overwrites the cells.
void makeCurveKeys(CurveCells& cells, std::size_t first, std::size_t count, std::uint64_t* keys);

/// Sorts keys by their positions along the curve, stably. Throws Cancelled.
/// @param progress  polled, unless null
void sortCurveKeys(std::vector<std::uint64_t>& keys, Progress* progress);

/// An item that is sorted by its position. All indices differ.
struct TreeItem {
    glm::vec3 place;
    std::uint32_t index;
};

/// Sorts items by recursive splitting instead of Hilbert order. Each split is at the median along the longest axis of
/// the positions, and fills whole groups of the tree. Splitting takes longer, but boxes overlap less. Throws Cancelled.
/// @param progress  polled, unless null
void sortBySplitting(std::vector<TreeItem>& items, Progress* progress);

}  // namespace bilayer::detail
