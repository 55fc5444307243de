// SPDX-License-Identifier: Apache-2.0
// Ground truth of a mesh at a point: its distance and winding number. It uses double precision and exact predicates,
// shares no code with the library, and is fast enough for millions of points. Fields are compared with it; its own
// tests compare it with sums over all triangles (support.h).
//
// The winding number sums signed crossings of a ray edge by edge, as J. O'Rourke ("Computational Geometry in C", 1998,
// 7.4) does for polygons. So crossings are counted exactly once even where the ray meets edges or vertices.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include <bilayer/sdf/mesh.h>

namespace bilayer::test {

/// Distances and winding numbers of one mesh, by a bounding volume hierarchy. Vertices need not be welded. Triangles
/// may be slivers, without area, or duplicates.
class Truth {
  public:
    /// Throws as validate() does.
    explicit Truth(const Mesh& mesh);

    /// The distance to the nearest triangle [m]. Safe from any thread.
    double distance(const glm::dvec3& point) const;

    /// The generalized winding number of a point that is not on the surface. It is an integer for closed meshes
    /// (balanced half-edges) and meaningless for others. Safe from any thread.
    int winding(const glm::dvec3& point) const;

    /// distance(), negated where winding() is positive.
    double signedDistance(const glm::dvec3& point) const;

  private:
    using Triangle = std::array<glm::dvec3, 3>;
    struct Node {
        glm::dvec3 lower, upper;
        std::uint32_t begin, end;  // range of triangles
        std::uint32_t after;       // the first node after this one's descendants; the next node for a leaf
    };

    void addNode(std::uint32_t begin, std::uint32_t end);
    void search(std::uint32_t index, const glm::dvec3& point, double& squared) const;

    std::vector<Triangle> triangles_;
    std::vector<Node> nodes_;
};

}  // namespace bilayer::test
