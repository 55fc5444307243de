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

    /// Returns whether any cluster or triangle is summed for each point.
    bool hasNear() const { return !clusters_.empty() || !triangles_.empty(); }

    /// Computes the winding number at a point of the ball [m], with a bound of its error: at least 1 if the point lies
    /// on a triangle, up to rounding, where the number jumps.
    WindingNumber::Estimate estimate(const glm::dvec3& point) const;

    /// As estimate(), in a tenth of the time: clusters and triangles near the ball only add to the error bound, by
    /// their area and distance.
    WindingNumber::Estimate coarseEstimate(const glm::dvec3& point) const;

  private:
    using Node = WindingNumber::Node;
    using Corners = WindingNumber::Corners;

    struct NearTriangle {
        glm::dvec3 centre;
        glm::dvec3 normal;     // its length is `area`
        double area;           // over 4 pi
        double squaredRadius;  // of a ball around the centre
        double squaredReach;   // farther from the centre than its root, the triangle counts as a dipole
        double error;          // of the dipole, times the fourth power of the distance
        const Corners* corners;
    };

    void addFar(const WindingCluster& node, const glm::dvec3& toCentre, double radius);
    void addTriangles(const Node& leaf, double radius);
    double clusterBound(double radius) const;
    WindingNumber::Estimate farEstimate(const glm::dvec3& point) const;

    const WindingNumber& winding_;
    glm::dvec3 centre_;
    // of the far clusters, at a displacement d from the centre: value + slope . d + d^T curvature d
    WindingNumber::Estimate far_{0, 0};
    glm::dvec3 slope_{0};
    Symmetric2 curvature_{};
    // near the ball
    std::vector<const Node*> clusters_;
    std::vector<NearTriangle> triangles_;
    double clusterBound_;  // of the winding number of the clusters, anywhere in the ball
};

}  // namespace bilayer::detail
