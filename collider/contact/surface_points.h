// Points on a body's surface in a tree of spheres: what is tested against another body's field.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <bilayer/sdf/mesh.h>

namespace bilayer::detail {

/// A surface point. Its index in SurfacePoints::points() is its feature: stable as long as the collider lives.
struct SurfacePoint {
    glm::vec3 position;  ///< [m]
    glm::vec3 normal;    ///< outward, of unit length
    bool isSharp;        ///< on a convex edge or corner, where surfaces of other normals meet
};

/// A node of the tree: a sphere around some consecutive points. Nodes lie in preorder: the first child of node i is
/// i + 1, the second is what follows the first one's subtree. A node is a leaf if `next` is i + 1.
struct PointNode {
    glm::vec3 centre;          ///< [m]
    float radius;              ///< [m]
    std::uint32_t begin, end;  ///< range of points
    std::uint32_t next;        ///< index of the node after this one's subtree
};

/// Points spread over a mesh's surface: every place of the surface has one within about `spacing` that looks about the
/// same way, and where the surface is round lies no lower than about 0.05 `spacing`; convex corners and edges sharper
/// than the surface around them keep theirs. Deterministic.
class SurfacePoints {
  public:
    SurfacePoints() = default;

    /// @param spacing  [m], positive and finite; else throws std::invalid_argument, as for an invalid mesh
    SurfacePoints(const Mesh& mesh, float spacing);

    /// The points() of another one, in the same order: has the same nodes, to the bit. At least one.
    explicit SurfacePoints(std::vector<SurfacePoint> ordered);

    std::span<const SurfacePoint> points() const { return points_; }
    std::span<const PointNode> nodes() const { return nodes_; }

    /// Visits the points near some region, in ascending order of their index, without memory of its own.
    /// @param reject  (const glm::vec3& centre, float radius) -> bool: true if nothing in that sphere is of interest
    /// @param visit   (std::uint32_t index, const SurfacePoint&), for each point of the leaves that remain
    template <class Reject, class Visit>
    void visit(Reject&& reject, Visit&& visit) const;

  private:
    std::vector<SurfacePoint> points_;
    std::vector<PointNode> nodes_;
};

template <class Reject, class Visit>
void SurfacePoints::visit(Reject&& reject, Visit&& visit) const {
    for (std::uint32_t i = 0; i < nodes_.size();) {
        const PointNode& node = nodes_[i];
        if (reject(node.centre, node.radius)) {
            i = node.next;
            continue;
        }
        if (node.next == i + 1)
            for (std::uint32_t p = node.begin; p < node.end; ++p) visit(p, points_[p]);
        ++i;
    }
}

}  // namespace bilayer::detail
