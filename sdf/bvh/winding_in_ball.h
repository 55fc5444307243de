// SPDX-License-Identifier: Apache-2.0
// The winding number at many points of a small ball: far clusters are summed once.
// Tested by tests/sdf/winding.cpp.
#pragma once

#include <glm/vec3.hpp>
#include <vector>

#include "sdf/bvh/symmetric_tensors.h"
#include "sdf/bvh/winding_number.h"

namespace bilayer::detail {

/// Estimates the winding number in a ball. What clusters far from the ball contribute is one polynomial of second
/// degree in the point's place; only clusters and triangles near the ball are summed for each point.
class WindingInBall {
  public:
    /// @param winding  must outlive this
    /// @param centre   [m]
    /// @param radius   [m]
    WindingInBall(const WindingNumber& winding, const glm::dvec3& centre, double radius);

    /// Computes the winding number at a point of the ball [m], with a bound of its error.
    WindingNumber::Estimate estimate(const glm::dvec3& point) const;

  private:
    using Node = WindingNumber::Node;

    void addFar(const Node& node, const glm::dvec3& toCentre, double radius);

    const WindingNumber& winding_;
    glm::dvec3 centre_;
    // of the far clusters, at a displacement d from the centre: value + slope . d + d^T curvature d
    WindingNumber::Estimate far_{0, 0};
    glm::dvec3 slope_{0};
    Symmetric2 curvature_{};
    std::vector<const Node*> clusters_, leaves_;  // near the ball
};

}  // namespace bilayer::detail
