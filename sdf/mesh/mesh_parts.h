// SPDX-License-Identifier: Apache-2.0
// The parts of a mesh, and tests of one part against another.
// Tested by tests/sdf/part_nesting.cpp through PartNesting.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <mutex>
#include <span>
#include <vector>

#include <bilayer/sdf/mesh.h>
#include "sdf/bvh/triangle_tree.h"

namespace bilayer::detail {

class Progress;

inline constexpr unsigned noPart = ~0u;

/// Sets of triangles. Safe from any thread.
class MeshParts {
  public:
    /// Keeps references to its arguments.
    /// @param partOf    the part of each triangle; `noPart` for triangles to ignore
    /// @param progress  polled, unless null
    MeshParts(const Mesh& mesh, std::span<const unsigned> partOf, std::size_t parts, Progress* progress);

    std::size_t count() const { return boxes_.size(); }
    bool empty(unsigned part) const { return first_[part] == first_[part + 1]; }
    const Bounds& box(unsigned part) const { return boxes_[part]; }
    /// Returns whether a part is connected, and has an even count of triangles at each of its edges. It then separates
    /// its inside from its outside, up to errors with a probability of about 2^-63.
    bool separates(unsigned part) const { return separates_[part] != 0; }

    /// Returns whether lines from three triangles of a part cross another part an odd number of times, and whether its
    /// box lies in the other's box. The orientation does not matter.
    bool contains(unsigned outer, unsigned inner) const;
    /// Returns all parts that contain a part, in order, from the hierarchy over the whole mesh.
    std::vector<unsigned> containersOf(unsigned inner, const TriangleTree& tree) const;
    /// Returns whether some triangles of two parts have a point in common, up to rounding.
    bool intersect(unsigned a, unsigned b) const;

  private:
    /// Count of lines that vote on whether a part lies within another: odd, and more than one in case a line hits an
    /// edge.
    static constexpr std::size_t votes = 3;

    std::span<const unsigned> members(unsigned part) const {
        return std::span(members_).subspan(first_[part], first_[part + 1] - first_[part]);
    }
    const TriangleTree& treeOf(unsigned part) const;
    glm::dvec3 start(unsigned part, std::size_t vote) const;
    std::vector<unsigned> crossedBy(unsigned part, std::size_t vote, const TriangleTree& tree) const;
    void findSeparating(Progress* progress);

    const Mesh& mesh_;
    std::span<const unsigned> partOf_;
    const std::vector<glm::dvec3> directions_;  // of the votes
    std::vector<std::size_t> first_;            // start of each part's triangles
    std::vector<unsigned> members_;             // triangles by part
    std::vector<Bounds> boxes_;
    std::vector<std::uint8_t> separates_;  // no bits, since parallel tasks write
    double slack_ = 0;                     // touching surfaces may be this far apart [m]
    mutable std::vector<std::once_flag> once_;
    mutable std::vector<std::unique_ptr<const TriangleTree>> trees_;  // built when first used
};

}  // namespace bilayer::detail
