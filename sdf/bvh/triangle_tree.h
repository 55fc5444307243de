// SPDX-License-Identifier: Apache-2.0
// A bounding volume hierarchy over the triangles of a mesh. It finds the triangles that overlap a box or a line.
// Boxes and corners are those of the mesh, without rounding.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/common.hpp>
#include <limits>
#include <span>
#include <vector>

#include <bilayer/sdf/mesh.h>
#include "sdf/base/large_array.h"
#include "sdf/bvh/box_tree.h"
#include "sdf/bvh/oriented_groups.h"

namespace bilayer::detail {

class Progress;

/// An intersection of a line with a triangle.
struct Crossing {
    unsigned triangle;
    double along;  ///< line parameter: distance from the origin in lengths of the direction
    int sign;      ///< +1: the line exits through the front of the triangle; -1: it enters there
};

/// Eight triangles. Unused slots repeat the last triangle.
struct TriangleLeaf {
    alignas(64) float corners[3][3][treeWidth];  ///< by corner, then by axis [m]
    std::uint32_t triangles[treeWidth];          ///< indices into Mesh::triangles
};

class TriangleTree {
  public:
    /// Keeps a reference to the mesh, which must be valid.
    /// @param progress  polled, unless null
    explicit TriangleTree(const Mesh& mesh, Progress* progress = nullptr);
    /// A hierarchy over some of the mesh's triangles.
    TriangleTree(const Mesh& mesh, std::span<const unsigned> triangles);

    /// Calls visit(triangle) for each triangle whose bounding box satisfies meets(box). If meets() holds for a box, it
    /// must hold for any box that contains it.
    template <class Meets, class Visit>
    void descend(const Meets& meets, const Visit& visit) const {
        if (boxes_.leafCount > 0) descend(boxes_.root(), meets, visit);
    }

    /// Finds all intersections of a line with triangles, in no particular order. Where the line crosses an edge that
    /// two triangles share, it intersects one of them. If it may hit an edge exactly, the triangles there are left out,
    /// and the answer is false.
    /// @param first  intersections beyond this line parameter; by default, of the line in both directions
    bool crossings(const glm::dvec3& origin, const glm::dvec3& direction, std::vector<Crossing>& found,
                   double first = -std::numeric_limits<double>::infinity()) const;

    Bounds boxOf(unsigned triangle) const {
        Bounds box;
        for (int k = 0; k < 3; ++k) box.add(mesh_.points[mesh_.triangles[triangle][k]]);
        return box;
    }

    const BoxTree& boxes() const { return boxes_; }
    /// Returns the oriented boxes of a group, or null if it has none. A mesh whose leaves hardly overlap has none.
    const OrientedGroup* orientedGroup(std::uint32_t node) const {
        const std::size_t group = node - boxes_.leafCount;
        return group < oriented_.groups.size() ? &oriented_.groups[group] : nullptr;
    }
    /// Returns the fans of an oriented group, or null if it has none.
    const FanGroup* fanGroup(const OrientedGroup& group) const {
        return group.fans == noFans ? nullptr : &oriented_.fans[group.fans];
    }
    std::size_t triangleCount() const { return count_; }
    const TriangleLeaf& leaf(std::size_t index) const { return leaves_[index]; }
    /// Returns the count of triangles in a leaf. Only the last leaf may have unused slots.
    std::size_t leafSize(std::size_t index) const {
        return index + 1 < leaves_.size() ? std::size_t(treeWidth) : count_ - index * treeWidth;
    }
    /// Returns the max absolute coordinate [m].
    float largestCoordinate() const { return largest_; }

  private:
    template <class Meets, class Visit>
    void descend(std::uint32_t node, const Meets& meets, const Visit& visit) const {
        if (boxes_.isLeaf(node)) {
            for (std::size_t i = 0; i < leafSize(node); ++i)
                if (const unsigned triangle = leaves_[node].triangles[i]; meets(boxOf(triangle))) visit(triangle);
            return;
        }
        const BoxGroup& group = boxes_.group(node);
        for (int i = 0; i < treeWidth; ++i) {
            const Bounds box{{group.lower[0][i], group.lower[1][i], group.lower[2][i]},
                             {group.upper[0][i], group.upper[1][i], group.upper[2][i]}};
            if (!box.empty() && meets(box)) descend(group.firstChild + std::uint32_t(i), meets, visit);
        }
    }

    void build(std::vector<TreeItem> items, Progress* progress);
    bool isCrowded() const;

    const Mesh& mesh_;
    std::size_t count_;  // of triangles
    float largest_ = 0;  // max absolute coordinate [m]
    BoxTree boxes_;
    LargeArray<TriangleLeaf> leaves_;
    OrientedGroups oriented_;  // of the first groups, where the mesh is crowded
};

/// Returns directions that are evenly distributed over a hemisphere (a Fibonacci lattice). None is parallel to an axis.
std::vector<glm::dvec3> spreadDirections(std::size_t count);

}  // namespace bilayer::detail
