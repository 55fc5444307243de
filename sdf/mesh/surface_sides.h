// SPDX-License-Identifier: Apache-2.0
// The winding numbers on the two sides of a place on a surface.
// Tested by tests/sdf/unite.cpp through unite().
#pragma once

#include <glm/vec3.hpp>
#include <mutex>
#include <optional>

#include <bilayer/sdf/mesh.h>
#include "sdf/bvh/triangle_tree.h"
#include "sdf/bvh/winding_number.h"

namespace bilayer::detail {

class Progress;

/// Winding numbers in front of a place and behind it. In open meshes, 1 stands for above 1/2, and 0 for other numbers.
struct SideNumbers {
    int front, behind;
};

class SurfaceSides {
  public:
    /// Keeps references to its arguments.
    /// @param closed    whether the mesh is balanced: winding numbers then are integers, and a line finds them
    /// @param progress  polled, unless null
    SurfaceSides(const Mesh& mesh, const TriangleTree& tree, bool closed, Progress* progress);

    /// Returns the numbers at two points close to a place within a triangle. Safe from any thread.
    /// @param step  from the place to the point in front of it, along the triangle's normal [m]
    SideNumbers at(const glm::dvec3& place, const glm::dvec3& step) const;

  private:
    std::optional<SideNumbers> alongLine(const glm::dvec3& place, const glm::dvec3& step,
                                         const glm::dvec3& oblique) const;
    double exitAlong(const glm::dvec3& place, const glm::dvec3& direction) const;
    const WindingNumber& winding() const;

    const Mesh& mesh_;
    const TriangleTree& tree_;
    const Bounds box_;
    const bool closed_;
    Progress* progress_;
    mutable std::once_flag once_;
    mutable std::optional<WindingNumber> winding_;  // built when first used
};

}  // namespace bilayer::detail
