// SPDX-License-Identifier: Apache-2.0
// The consistently oriented components of a mesh, with their volume and their border.
// Tested by tests/sdf/orient.cpp.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include <bilayer/sdf/mesh.h>
#include "sdf/mesh/consistent_triangles.h"

namespace bilayer::detail {

struct OrientedComponent {
    Bounds bounds;
    std::vector<unsigned> triangles;
    std::uint64_t edgeSum = 0;  ///< zero: closed
    double area = 0, flippedArea = 0;
    double volume = 0;  ///< as oriented; open components are closed by a cone over the border's centre
    glm::dvec3 borderCentre{0};
    double borderLength = 0;
    bool oneSided = false;
    bool mixed = false;     ///< some, but not all, of its triangles were flipped for consistency
    bool flipped = false;   ///< flipped as a whole
    bool twoSided = false;  ///< consists of back-to-back faces that enclose nothing; left unchanged

    bool closed() const { return edgeSum == 0; }
    /// Returns the apex of the cones whose volumes are summed.
    glm::dvec3 apex() const;
    /// Returns whether it separates inside from outside.
    bool bounding() const;
};

/// The components of a mesh. Each has the orientation of most of its area at first.
class OrientedComponents {
  public:
    /// @param consistent  of the mesh
    OrientedComponents(const Mesh& mesh, ConsistentTriangles& consistent);

    std::span<const OrientedComponent> all() const { return components_; }
    /// Returns whether a triangle is flipped.
    bool isFlipped(unsigned triangle) const { return flipped_[triangle]; }
    /// Flips a component as a whole.
    void flip(std::size_t component);

  private:
    OrientedComponent& componentOf(unsigned triangle) { return components_[componentOf_[triangle]]; }
    glm::dvec3 point(unsigned triangle, int k) const { return mesh_.points[mesh_.triangles[triangle][k]]; }
    glm::dvec3 areaVector(unsigned triangle) const;
    void gather();
    void findTwoSided();
    void keepMajority();
    void flip(OrientedComponent& component);
    void measure();
    void findBorders();

    const Mesh& mesh_;
    ConsistentTriangles& consistent_;
    std::vector<OrientedComponent> components_;
    std::vector<unsigned> componentOf_;  // for each triangle
    std::vector<bool> flipped_;          // for each triangle
};

}  // namespace bilayer::detail
