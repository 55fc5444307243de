// A tree of boxes, eight to a group, eight groups to a larger one, and so on upward, with no pointers and no choices
// that cost time, over leaves that stand along Hilbert's curve. What a leaf is, its user knows: eight triangles,
// mostly.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include "sdf/base/large_array.h"

namespace bilayer::detail {

class Progress;

inline constexpr int treeWidth = 8;  ///< triangles a leaf and boxes a group: a vector of floats

/// The boxes of eight leaves or of eight groups; a box that is left over is empty: infinitely far away.
struct BoxGroup {
    alignas(64) float lower[3][treeWidth];
    float upper[3][treeWidth];
    std::uint32_t firstChild;  ///< the node of the first box; the others follow
};

/// Nodes are numbered: first the leaves, then the groups from the finest to the coarsest; the last one is the root.
struct BoxTree {
    std::uint32_t leafCount = 0, groupCount = 0;
    LargeArray<BoxGroup> groups;

    bool isLeaf(std::uint32_t node) const { return node < leafCount; }
    const BoxGroup& group(std::uint32_t node) const { return groups[node - leafCount]; }
    std::uint32_t root() const { return leafCount + groupCount - 1; }

    /// Takes memory for the groups over so many leaves, at least one.
    void makeRoom(std::size_t leaves);
    /// Any thread may set the box of any leaf, each once.
    void setLeafBox(std::size_t leaf, const glm::vec3& lower, const glm::vec3& upper);
    /// Makes the boxes of groups from those of the leaves. Throws Cancelled.
    void joinBoxes(Progress* progress);
};

/// Cells along an axis of the cube that Hilbert's curve runs through.
inline constexpr std::uint32_t curveCells = 1 << 12;
/// A place along the curve and the number of what is there share 64 bits.
inline constexpr std::size_t maxOnCurve = std::size_t(1) << 28;
inline constexpr std::uint64_t curveIndexMask = maxOnCurve - 1;

/// Coordinates of cells, in runs so that the compiler can use vectors.
struct CurveCells {
    static constexpr std::size_t most = 64;
    std::uint32_t x[3][most];
};

/// Writes the keys of what lies in the first `count` cells, numbered from `first`. The cells are changed.
void makeCurveKeys(CurveCells& cells, std::size_t first, std::size_t count, std::uint64_t* keys);

/// Sorts keys by their places along the curve, stably. Throws Cancelled.
/// @param progress  polled, unless null
void sortCurveKeys(std::vector<std::uint64_t>& keys, Progress* progress);

/// What is put into an order by where it is; all indices differ.
struct TreeItem {
    glm::vec3 place;
    std::uint32_t index;
};

/// Puts items into an order by splitting, instead of that along the curve: halves by the middle of the longest side of
/// where they are, those halved again, and so on, each in full groups as the tree has them. It takes longer, and boxes
/// overlap less. Throws Cancelled.
/// @param progress  polled, unless null
void sortBySplitting(std::vector<TreeItem>& items, Progress* progress);

}  // namespace bilayer::detail
