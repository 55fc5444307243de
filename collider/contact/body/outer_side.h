// SPDX-License-Identifier: Apache-2.0
// The side of an open surface that faces away from its body.
// Tested by tests/collider/surface_points.cpp through SurfacePoints.
#pragma once

#include <glm/vec3.hpp>

#include <bilayer/sdf/mesh.h>
#include "collider/field/triangles/mesh_tree.h"

namespace bilayer::detail {

/// Compares the two sides of a surface by rays. On the outer side, they go farther before they meet the body again.
class OuterSide {
  public:
    /// @param spacing  of surface points [m]
    OuterSide(const Mesh& mesh, double spacing);

    /// Whether the other side is the outer one. No side is if both see about as far.
    /// @param position  on the surface [m]
    /// @param normal    of the surface, of unit length, towards the side in question
    bool isInner(const glm::dvec3& position, const glm::dvec3& normal) const;

  private:
    double meanView(const glm::dvec3& position, const glm::dvec3& normal) const;

    MeshTree mesh_;
    double size_, start_;  // lengths of rays, and of their distance from the surface [m]
};

}  // namespace bilayer::detail
