// A tree of boxes over the triangles of a mesh: which triangles meet a box or a line, and which parts of the mesh lie
// within which others. Boxes and corners are those of the mesh, without rounding.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/common.hpp>
#include <span>
#include <vector>

#include <bilayer/sdf/mesh.h>
#include "sdf/base/large_array.h"
#include "sdf/bvh/box_tree.h"

namespace bilayer::detail {

class Progress;

/// A triangle met by a line.
struct Crossing {
    unsigned triangle;
    double along;  ///< from the line's origin, in lengths of its direction
    int sign;      ///< +1: the line leaves through the front of the triangle; -1: it enters there
};

/// Eight triangles. Places that are left over repeat the last one.
struct TriangleLeaf {
    alignas(64) float corners[3][3][treeWidth];  ///< by corner, then axis [m]
    std::uint32_t triangles[treeWidth];          ///< indices into Mesh::triangles
};

class TriangleTree {
  public:
    /// Keeps a reference to the mesh, which must be valid.
    /// @param progress  polled, unless null
    explicit TriangleTree(const Mesh& mesh, Progress* progress = nullptr);

    /// Calls visit(triangle) for the triangles whose own boxes meets(box) holds for; it must hold for any box around
    /// such a box.
    template <class Meets, class Visit>
    void descend(const Meets& meets, const Visit& visit) const {
        if (boxes_.leafCount > 0) descend(boxes_.root(), meets, visit);
    }

    /// All triangles that a line meets, both ways, in no order. An edge that two triangles share is met once, but for
    /// lines that hit it exactly.
    void crossings(const glm::dvec3& origin, const glm::dvec3& direction, std::vector<Crossing>& found) const;

    Bounds boxOf(unsigned triangle) const {
        Bounds box;
        for (int k = 0; k < 3; ++k) box.add(mesh_.points[mesh_.triangles[triangle][k]]);
        return box;
    }

    const BoxTree& boxes() const { return boxes_; }
    std::size_t triangleCount() const { return mesh_.triangles.size(); }
    const TriangleLeaf& leaf(std::size_t index) const { return leaves_[index]; }
    /// The number of triangles in a leaf; only the last one may have places that are left over.
    std::size_t leafSize(std::size_t index) const {
        return index + 1 < leaves_.size() ? std::size_t(treeWidth) : mesh_.triangles.size() - index * treeWidth;
    }
    /// The largest coordinate, in size [m].
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

    const Mesh& mesh_;
    float largest_ = 0;  // coordinate [m]
    BoxTree boxes_;
    LargeArray<TriangleLeaf> leaves_;
};

/// Directions spread evenly over half the sphere (a Fibonacci lattice), none along an axis.
std::vector<glm::dvec3> spreadDirections(std::size_t count);

inline constexpr unsigned noPart = ~0u;

/// For each part of a mesh, the parts that it lies within: lines from three of its triangles cross them an odd number
/// of times, and their boxes hold its box. Their orientation does not matter.
/// @param partOf    the part of each triangle; `noPart` for triangles that neither hold nor lie in anything
/// @param progress  polled, unless null
std::vector<std::vector<unsigned>> enclosingParts(const Mesh& mesh, const TriangleTree& tree,
                                                  std::span<const unsigned> partOf, std::size_t parts,
                                                  Progress* progress = nullptr);

}  // namespace bilayer::detail
