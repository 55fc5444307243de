// SPDX-License-Identifier: Apache-2.0
// Points on a body's surface in a bounding sphere hierarchy. They are tested against another body's field.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include <bilayer/sdf/mesh.h>
#include "sdf/bvh/median_tree.h"

namespace bilayer::detail {

/// A surface point. Its index in SurfacePoints::points() is its feature id, stable for the life of the collider.
struct SurfacePoint {
    glm::vec3 position;  ///< [m]
    glm::vec3 normal;    ///< outward, of unit length
    bool isSharp;        ///< on a convex edge or vertex, where faces with different normals meet; or on a border
    /// On the inner side or the border of an open surface. Such points make no contact with triangles, which are
    /// two-sided: only a point on the outer side shows from which side of a triangle the body comes.
    bool isInner = false;
};

/// A sphere around points.
struct PointSphere {
    glm::vec3 centre;  ///< [m]
    float radius;      ///< [m]
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

    /// From the points() of another one, in the same order; the spheres are equal bit for bit. Needs at least one
    /// point.
    explicit SurfacePoints(std::vector<SurfacePoint> ordered);

    std::span<const SurfacePoint> points() const { return points_; }
    const MedianTree<PointSphere>& tree() const { return tree_; }

    /// Visits the points near a region, in ascending order of their index, without allocation.
    /// @param reject  (const glm::vec3& centre, float radius) -> bool: true if the sphere contains nothing of interest
    /// @param visit   (std::uint32_t index, const SurfacePoint&): called for each point of the remaining leaves
    template <class Reject, class Visit>
    void visit(Reject&& reject, Visit&& visit) const;

  private:
    template <class Split>
    void buildTree(const Split& split);

    std::vector<SurfacePoint> points_;
    MedianTree<PointSphere> tree_;
};

template <class Reject, class Visit>
void SurfacePoints::visit(Reject&& reject, Visit&& visit) const {
    tree_.forEachLeaf([&](const PointSphere& sphere) { return reject(sphere.centre, sphere.radius); },
                      [&](const auto& leaf) {
                          for (std::uint32_t p = leaf.begin; p < leaf.end; ++p) visit(p, points_[p]);
                          return true;
                      });
}

}  // namespace bilayer::detail
