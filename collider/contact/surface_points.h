// SPDX-License-Identifier: Apache-2.0
// Points on a body's surface in a bounding sphere hierarchy. They are tested against another body's field.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include <bilayer/sdf/mesh.h>

namespace bilayer::detail {

/// A surface point. Its index in SurfacePoints::points() is its feature id, stable for the life of the collider.
struct SurfacePoint {
    glm::vec3 position;  ///< [m]
    glm::vec3 normal;    ///< outward, of unit length
    bool isSharp;        ///< on a convex edge or vertex, where faces with different normals meet; or on a border
    /// On the inner side or the border of an open surface. Triangles of another body have two sides, too: only the
    /// outer side, which faces away from the body, shows which of them it comes from. Inner points do not touch them.
    bool isInner = false;
};

/// A node of the tree: a bounding sphere of consecutive points. Nodes are in preorder: the first child of node i is i +
/// 1; the second child follows the subtree of the first. A node is a leaf if `next` is i + 1.
struct PointNode {
    glm::vec3 centre;          ///< [m]
    float radius;              ///< [m]
    std::uint32_t begin, end;  ///< range of points
    std::uint32_t next;        ///< index of the node after this subtree
};

/// Points distributed over a mesh's surface. Every place of the surface has a point with about the same normal within
/// about `spacing`. On curved surfaces this point is at most about 0.05 `spacing` lower along the normal. Convex
/// vertices and edges that are sharper than the surface around them have their own points. Open surfaces have points on
/// both sides, and points on their borders whose normals point away from the surface. Deterministic.
class SurfacePoints {
  public:
    SurfacePoints() = default;

    /// Whether a place is outside of a body [m]. Called from several threads at a time.
    using IsOutside = std::function<bool(const glm::dvec3& place)>;

    /// Throws std::invalid_argument for an invalid mesh.
    /// @param spacing    [m], positive and finite; otherwise throws std::invalid_argument
    /// @param isOutside  finds open surfaces, which have the outside on both sides. Empty if there are none.
    SurfacePoints(const Mesh& mesh, float spacing, const IsOutside& isOutside = {});

    /// From the points() of another one, in the same order; the nodes are equal bit for bit. Needs at least one point.
    explicit SurfacePoints(std::vector<SurfacePoint> ordered);

    std::span<const SurfacePoint> points() const { return points_; }
    std::span<const PointNode> nodes() const { return nodes_; }

    /// Visits the points near a region, in ascending order of their index, without allocation.
    /// @param reject  (const glm::vec3& centre, float radius) -> bool: true if the sphere contains nothing of interest
    /// @param visit   (std::uint32_t index, const SurfacePoint&): called for each point of the remaining leaves
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
