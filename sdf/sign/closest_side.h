// On which side of the mesh a point lies, by the angle-weighted pseudonormal of the closest feature: J. A. Baerentzen,
// H. Aanaes, "Signed distance computation using the angle weighted pseudonormal", IEEE TVCG 11 (2005) 243-253.
//
// The normals are summed over the triangles that meet the closest point, found by geometry and not by indices: vertices
// need not be welded, edges need no adjacency, duplicate faces count once and faces without area not at all.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <optional>
#include <vector>

#include <bilayer/sdf/mesh.h>

namespace bilayer::detail {

/// What the closest feature says of a point. `undecided` where normals nearly cancel out: at a vertex where two parts
/// of the surface touch they mean nothing, and at a needle's tip little.
enum class Side { outside, inside, undecided };

/// Finds the side of one point: offer every triangle that may be nearest, in any order and more than once if need be.
class ClosestSide {
  public:
    ClosestSide(const Mesh& mesh, double voxelsPerUnit) : mesh_(mesh), voxelsPerUnit_(voxelsPerUnit) {}

    /// Begins with a point [voxels].
    void begin(const glm::dvec3& point);

    /// Adds a triangle.
    void offer(std::uint32_t triangle);

    /// The side by all triangles offered; `undecided` where the normals at the closest point cancel out.
    Side side() const;

    /// The corners of a triangle as seen from the point [voxels].
    std::array<glm::dvec3, 3> cornersOf(std::uint32_t triangle) const;

    /// The distance to the nearest triangle offered [voxels].
    double distance() const { return distance_; }

  private:
    struct Face {
        std::uint32_t triangle;
        std::array<glm::dvec3, 3> corners;  // from the point [voxels]
        glm::dvec3 closest;                 // likewise
        double distance;
    };

    const Mesh& mesh_;
    double voxelsPerUnit_;
    glm::dvec3 point_{0};
    double distance_ = 0;
    std::vector<Face> faces_;
};

/// How the way from the origin to `way` passes a triangle: +1 along its normal, -1 against it, 0 not at all; nothing if
/// it passes too close to an edge, a corner or its own ends to tell.
std::optional<int> passing(const std::array<glm::dvec3, 3>& corners, const glm::dvec3& way);

/// The point of a triangle that is closest to the origin. Right for triangles without area too.
glm::dvec3 closestToOrigin(const std::array<glm::dvec3, 3>& corners);

}  // namespace bilayer::detail
