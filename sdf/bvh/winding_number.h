// SPDX-License-Identifier: Apache-2.0
// The generalized winding number: the share of all directions in which a point sees the inner side of the surface.
//
// A. Jacobson, L. Kavan, O. Sorkine-Hornung, "Robust inside-outside segmentation using generalized winding numbers",
// ACM TOG 32 (2013). Clusters of triangles are approximated by their moments: G. Barill, N. Dickson, R. Schmidt, D.
// Levin, A. Jacobson, "Fast winding numbers for soups and clouds", ACM TOG 37 (2018).
// Tested by tests/sdf/winding.cpp.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include <bilayer/sdf/mesh.h>
#include "sdf/bvh/median_tree.h"
#include "sdf/bvh/winding_cluster.h"

namespace bilayer::detail {

class Progress;

/// The generalized winding number of a mesh: near 1 inside of a closed mesh that is oriented outward, near 0 outside.
/// Stores a hierarchy of triangles, 72 to 108 bytes per triangle. Thread-safe.
class WindingNumber {
  public:
    /// Throws std::invalid_argument as validate() does. The mesh need not outlive the constructor.
    /// @param progress  polled while the hierarchy is built, unless null
    explicit WindingNumber(const Mesh& mesh, Progress* progress = nullptr);

    using Estimate = WindingEstimate;

    /// Computes the winding number at a point [m]. Refines until the error is below `share` (0..1) times the difference
    /// of the value from 1/2. If necessary it descends to single triangles. The result is therefore on the correct side
    /// of 1/2, unless the true number equals 1/2 up to rounding.
    Estimate estimate(const glm::dvec3& point, double share) const;
    double operator()(const glm::dvec3& point) const { return estimate(point, 0.5).value; }

    /// Returns whether the winding number at a point [m] is above one half. Right as estimate() is. Allocates nothing.
    bool isInside(const glm::dvec3& point) const noexcept;

    /// Returns the winding number at a point [m], rounded to an integer. Meant for closed meshes.
    int nearestInteger(const glm::dvec3& point) const;

    /// Returns whether any triangle intersects or touches the segment between two points [m].
    bool meets(const glm::dvec3& from, const glm::dvec3& to) const;

    double area() const { return tree_[0].area; }  ///< of all triangles [m^2]
    std::size_t memoryBytes() const noexcept;

  private:
    friend class WindingInBall;

    /// Error of an estimate that only decides the side, as a share of its distance to 1/2: 1, less a margin for
    /// rounding.
    static constexpr double onlySide = 0.999;

    using Corners = WindingCluster::Corners;
    using Tree = MedianTree<WindingCluster>;
    using Node = Tree::Node;

    double solidAngles(const Node& node, const glm::dvec3& point) const;
    Estimate sumOf(std::uint32_t at, const glm::dvec3& point, double maxError) const;
    void refine(std::uint32_t at, const glm::dvec3& point, Estimate& sum, std::vector<std::uint32_t>& open) const;

    std::vector<Corners> triangles_;
    Tree tree_;
};

}  // namespace bilayer::detail
