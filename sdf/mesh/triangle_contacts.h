// SPDX-License-Identifier: Apache-2.0
// Where the triangles of a mesh cross or touch each other.
// Tested by tests/sdf/unite.cpp through unite().
#pragma once

#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <vector>

#include <bilayer/sdf/mesh.h>
#include "sdf/base/triangle_corners.h"
#include "sdf/bvh/triangle_tree.h"
#include "sdf/mesh/topology.h"
#include "sdf/mesh/triangle_cut.h"

namespace bilayer::detail {

/// A triangle in double precision.
struct DoubleTriangle {
    TriangleCorners corners;
    glm::dvec3 normal;  // unit normal, or 0 for a triangle without area
    double area;

    DoubleTriangle(const Mesh& mesh, const glm::uvec3& t) : corners(cornersOf(mesh, t)) {
        normal = glm::cross(corners[1] - corners[0], corners[2] - corners[0]);
        area = 0.5 * glm::length(normal);
        normal = area > 0 ? 0.5 / area * normal : glm::dvec3(0);
    }

    Polygon polygon() const { return {corners.begin(), corners.end()}; }
    glm::dvec3 centroid() const { return (corners[0] + corners[1] + corners[2]) / 3.0; }
    double height(const glm::dvec3& p) const { return glm::dot(normal, p - corners[0]); }
    glm::dvec3 onPlane(const glm::dvec3& p) const { return p - height(p) * normal; }
};

/// Finds where other triangles cross or touch a triangle. Keeps references to its arguments.
class TriangleContacts {
  public:
    /// @param slack  surfaces closer than this count as touching [m]
    TriangleContacts(const Mesh& mesh, const Topology& topology, const TriangleTree& tree, double slack)
        : mesh_(mesh), topology_(topology), tree_(tree), slack_(slack) {}

    /// Returns the contact segments that reach into a triangle, except for edges and vertices that it shares with
    /// neighbours. They lie in its plane, and may extend beyond it.
    std::vector<Segment> within(unsigned triangle) const;

  private:
    void add(unsigned triangle, const DoubleTriangle& face, unsigned other, const TriangleCorners& corners,
             std::vector<Segment>& found) const;
    bool alongSharedEdge(unsigned triangle, unsigned other, const DoubleTriangle& face, const Segment& segment) const;
    bool atSharedVertex(unsigned triangle, unsigned other, const DoubleTriangle& face, const Segment& segment) const;

    const Mesh& mesh_;
    const Topology& topology_;
    const TriangleTree& tree_;
    const double slack_;
};

}  // namespace bilayer::detail
