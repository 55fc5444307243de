// SPDX-License-Identifier: Apache-2.0
// The gradient of the winding number away from the surface of an open mesh.
// Tested by tests/sdf/winding.cpp.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include <bilayer/sdf/mesh.h>

namespace bilayer::detail {

class Progress;

/// An upper bound on the gradient of the winding number. Away from the surface, the gradient equals the field of a
/// current along the boundary of the mesh (Biot-Savart law). Edges with balanced half-edges do not contribute.
/// Thread-safe.
class WindingSlope {
  public:
    /// @param progress  polled, unless null
    explicit WindingSlope(const Mesh& mesh, Progress* progress = nullptr);

    /// Returns an upper bound on the gradient's magnitude in a ball [1/m]. Links in the ball must not cross the
    /// surface.
    double operator()(const glm::dvec3& centre, double radius) const;

  private:
    struct UnbalancedEdge {
        glm::dvec3 from, to;
        double excess;  // of half-edges in one direction over the other
        glm::vec3 at;   // midpoint
        std::uint32_t index;
    };
    struct Node {
        glm::dvec3 centre;
        double radius, length;
        std::size_t begin, end, right;
    };
    static constexpr std::size_t leafEdges = 4;

    void build(std::size_t at, std::size_t begin, std::size_t end, Progress* progress);
    double bound(std::size_t at, const glm::dvec3& centre, double radius) const;
    static double ofEdge(const UnbalancedEdge& edge, const glm::dvec3& centre, double radius);

    std::vector<UnbalancedEdge> edges_;
    std::vector<Node> nodes_;
};

}  // namespace bilayer::detail
