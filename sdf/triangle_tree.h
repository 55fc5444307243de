// A tree of boxes over the triangles of a mesh: which triangles meet a box or a line, and which parts of the mesh lie
// within which others. The boxes of each level stand in an array of their own, over triangles in Morton order.
#pragma once

#include <cstdint>
#include <glm/common.hpp>
#include <span>
#include <vector>

#include "sdf/mesh.h"

namespace bilayer {

class Progress;

/// A triangle met by a line.
struct Crossing {
    unsigned triangle;
    double along;  ///< from the line's origin, in lengths of its direction
    int sign;      ///< +1: the line leaves through the front of the triangle; -1: it enters there
};

class TriangleTree {
  public:
    /// @param progress  polled, unless null
    explicit TriangleTree(const Mesh& mesh, Progress* progress = nullptr);

    /// Calls visit(triangle) for the triangles whose own boxes meets(box) holds for; it must hold for any box around
    /// such a box.
    template <class Meets, class Visit>
    void descend(const Meets& meets, const Visit& visit) const {
        if (!levels_.empty() && meets(levels_.back()[0])) descend(levels_.size() - 1, 0, meets, visit);
    }

    /// All triangles that a line meets, both ways, in no order. An edge that two triangles share is met once, but for
    /// lines that hit it exactly.
    void crossings(const glm::dvec3& origin, const glm::dvec3& direction, std::vector<Crossing>& found) const;

    const Bounds& boxOf(unsigned triangle) const { return boxes_[triangle]; }

  private:
    static constexpr std::size_t fanOut = 4;  // children of a box, and triangles of the lowest ones

    template <class Meets, class Visit>
    void descend(std::size_t level, std::size_t node, const Meets& meets, const Visit& visit) const {
        const std::size_t count = level ? levels_[level - 1].size() : order_.size();
        const std::size_t begin = fanOut * node, end = begin + fanOut < count ? begin + fanOut : count;
        for (std::size_t i = begin; i < end; ++i)
            if (level) {
                if (meets(levels_[level - 1][i])) descend(level - 1, i, meets, visit);
            } else if (meets(boxes_[order_[i]]))
                visit(order_[i]);
    }

    const Mesh& mesh_;
    double slack_;                             // widens boxes against rounding [m]
    std::vector<Bounds> boxes_;                // of each triangle
    std::vector<unsigned> order_;              // triangles in Morton order
    std::vector<std::vector<Bounds>> levels_;  // the lowest first
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

}  // namespace bilayer
