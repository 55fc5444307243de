// Points on a body's surface in a tree of spheres: what is tested against another body's field.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "sdf/mesh.h"

namespace bilayer {

/// A surface point. Its index in SurfacePoints::points() is its feature: stable as long as the collider lives.
struct SurfacePoint {
    glm::vec3 position;  ///< [m]
    glm::vec3 normal;    ///< outward, of unit length
};

/// A node of the tree: a sphere around some consecutive points. Children of node i are i + 1 and `right`.
struct PointNode {
    glm::vec3 centre;         ///< [m]
    float radius;             ///< [m]
    std::uint32_t begin, end; ///< range of points
    std::uint32_t right;      ///< the second child; 0: a leaf
};

/// Points spread over a mesh's surface, at most about `spacing` apart, that always hold the mesh's convex corners.
class SurfacePoints {
  public:
    SurfacePoints() = default;
    SurfacePoints(const Mesh& mesh, float spacing);

    std::span<const SurfacePoint> points() const { return points_; }
    std::span<const PointNode> nodes() const { return nodes_; }

  private:
    std::vector<SurfacePoint> points_;
    std::vector<PointNode> nodes_;
};

}  // namespace bilayer
