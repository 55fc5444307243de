// SPDX-License-Identifier: Apache-2.0
// Classifies the two sides of a surface by winding numbers: does the surface bound a solid?
//
// The winding number is that of A. Jacobson, L. Kavan, O. Sorkine-Hornung, "Robust inside-outside segmentation using
// generalized winding numbers" (SIGGRAPH 2013), as the mean over all directions of the signed crossings of a ray.
// Tested by tests/sdf/sign_choice.cpp.
#pragma once

#include <cstddef>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include <bilayer/sdf/mesh.h>
#include "sdf/bvh/triangle_tree.h"

namespace bilayer::detail {

/// What a surface bounds, as shares of its area (estimated at a few hundred points).
struct Bounding {
    double solid = 0;     ///< winding number clearly above 1/2 behind, clearly below in front: surface of a solid
    double buried = 0;    ///< clearly above 1/2 on both sides: inside the solid
    double reversed = 0;  ///< the solid is in front
    double nothing = 0;   ///< the rest: open surfaces, and where holes leave the winding number near 1/2
};

/// Estimates the winding numbers on both sides of a surface. Keeps references to its arguments.
class Sides {
  public:
    /// @param progress  polled, unless null
    /// @param closed    whether the mesh is balanced, so that few lines suffice
    Sides(const Mesh& mesh, const TriangleTree& tree, Progress* progress = nullptr, bool closed = false);

    /// Classifies some of the triangles at `samples` points, each of which represents an equal share of their area.
    /// Deterministic.
    Bounding measure(std::span<const unsigned> triangles, std::size_t samples) const;

  private:
    double area(unsigned triangle) const;
    void add(unsigned triangle, std::size_t sample, Bounding& sum) const;

    const Mesh& mesh_;
    const TriangleTree& tree_;
    Progress* progress_;
    double samePlace_;  // max distance of coincident surfaces [m]
    std::vector<glm::dvec3> directions_;
};

/// Classifies a mesh as a whole. The mesh must be valid.
/// @param progress  polled, unless null
/// @param closed    whether the mesh is balanced, so that few lines suffice
Bounding bounding(const Mesh& mesh, Progress* progress = nullptr, bool closed = false);

}  // namespace bilayer::detail
