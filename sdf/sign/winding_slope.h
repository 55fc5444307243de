// SPDX-License-Identifier: Apache-2.0
// The gradient of the winding number away from the surface of an open mesh.
// Tested by tests/sdf/winding.cpp through signByWinding().
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include <bilayer/sdf/mesh.h>
#include "sdf/bvh/median_tree.h"

namespace bilayer::detail {

class Progress;

/// An upper bound on the gradient of the winding number. Away from the surface, the gradient equals the field of a
/// current along the boundary of the mesh (Biot-Savart law). Edges with balanced half-edges do not contribute.
/// Thread-safe.
class WindingSlope {
  public:
    /// @param progress  polled, unless null
    explicit WindingSlope(const Mesh& mesh, Progress* progress = nullptr);

    /// Returns an upper bound on the gradient's magnitude in a ball [1/m]. No line in the ball may cross
    /// the surface.
    double operator()(const glm::dvec3& centre, double radius) const;

  private:
    struct UnbalancedEdge {
        glm::dvec3 from, to;
        double excess;  // of half-edges in one direction over the other
        glm::vec3 at;   // midpoint
        std::uint32_t index;
    };
    /// A ball around edges.
    struct Ball {
        glm::dvec3 centre;
        double radius;
        double length;  // of the edges, each times its excess
    };

    Ball ballOf(std::uint32_t node) const;
    double bound(std::uint32_t node, const glm::dvec3& centre, double radius) const;
    static double ofEdge(const UnbalancedEdge& edge, const glm::dvec3& centre, double radius);

    std::vector<UnbalancedEdge> edges_;
    MedianTree<Ball> tree_;
};

}  // namespace bilayer::detail
