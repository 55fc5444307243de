// The truth about a mesh at a point: how far its surface is, and how often it winds around the point. Double precision
// and exact predicates, no line shared with the library, fast enough for millions of points. Fields are judged by it;
// it is itself tested against sums over all triangles (support.h).
//
// Winding by signed crossings of a ray: the sum that J. O'Rourke ("Computational Geometry in C", 1998, 7.4) takes for
// polygons, edge by edge, so that crossings add up without a gap or a doublet wherever the ray meets edges or vertices.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include <bilayer/sdf/mesh.h>

namespace bilayer::test {

/// Distances and winding numbers of one mesh, by a tree of boxes. Vertices need not be welded; triangles may be
/// slivers, without area, or there twice.
class Truth {
  public:
    /// Throws as validate() does.
    explicit Truth(const Mesh& mesh);

    /// The distance to the nearest triangle [m]. Safe from any thread.
    double distance(const glm::dvec3& point) const;

    /// How often the surface winds around a point that does not lie on it: the generalized winding number, an integer
    /// for closed meshes (each edge run both ways equally often). Means nothing for others. Safe from any thread.
    int winding(const glm::dvec3& point) const;

    /// distance(), negative where winding() is positive.
    double signedDistance(const glm::dvec3& point) const;

  private:
    using Triangle = std::array<glm::dvec3, 3>;
    struct Node {
        glm::dvec3 lower, upper;
        std::uint32_t begin, end;  // range of triangles
        std::uint32_t after;       // the first node beyond this one's children; the next one: a leaf
    };

    void addNode(std::uint32_t begin, std::uint32_t end);
    void search(std::uint32_t index, const glm::dvec3& point, double& squared) const;

    std::vector<Triangle> triangles_;
    std::vector<Node> nodes_;
};

}  // namespace bilayer::test
