// SPDX-License-Identifier: Apache-2.0
// Convex bodies in closed form: signed distance, and the features to be tested against a field.
// Tested by tests/bullet/convex.cpp.
#pragma once

#include <memory>
#include <vector>

#include "collider/contact/shapes/convex_core.h"
#include "collider/contact/shapes/hull_core.h"
#include "collider/contact/shapes/multisphere.h"

namespace bilayer::detail {

/// A convex body as a core (segment, box, solid of revolution, hull of points or spheres) grown by a radius, in metres.
/// Copies share the core.
class Convex {
  public:
    /// @param axis  0 to 2: the coordinate along the segment
    static Convex segment(int axis, float halfHeight, float radius);
    static Convex box(const glm::vec3& halfExtents);
    /// A truncated cone between two discs.
    /// @param lowerRadius, upperRadius  of the discs at the ends of the axis
    /// @param radius                    growth
    static Convex revolution(int axis, float halfHeight, float lowerRadius, float upperRadius, float radius);
    static Convex hull(const HullSurface& surface, float radius);
    static Convex spheres(std::vector<SphereOfHull> spheres);

    /// The nearest point of the surface. For a hull, beyond `reach` outside, the distance is only a lower bound.
    NearestPoint nearest(const glm::vec3& point, float reach) const;

    struct PathHit {
        float fraction;        ///< of the path at which the point comes within the tolerance
        NearestPoint nearest;  ///< there
    };
    /// The first point of a straight path that is within the tolerance of the body; the start if that is inside.
    /// @param tolerance  [m]
    std::optional<PathHit> castPoint(const glm::vec3& start, const glm::vec3& displacement, float tolerance) const;

    /// Whether the surface is curved. The surface points of a field alone would then miss the deepest point between
    /// them.
    bool isCurved() const { return core_->isCurved(); }
    /// The point of the surface around its nearest point that is farthest in a direction of unit length.
    glm::vec3 supportNear(const NearestPoint& nearest, const glm::vec3& direction) const {
        return core_->supportNear(nearest, direction) + nearest.radius * direction;
    }
    /// The farthest point in a direction of the core, which is the body without its growth().
    glm::vec3 support(const glm::vec3& direction) const { return core_->support(direction); }
    /// 0 for spheres, whose radii differ [m].
    float growth() const { return growth_; }
    /// The radius of a ball around the origin that holds the body [m].
    double boundingRadius() const;

    /// Whether the core is flat at the nearest point.
    bool isFlat(const NearestPoint& nearest) const { return core_->isFlat(nearest); }
    /// Whether the surface is curved and smooth there.
    bool isRound(const NearestPoint& nearest) const { return core_->isRound(nearest); }
    /// The ends of the generator line through a point on the side of a solid of revolution. Nothing on its flat ends,
    /// and for other shapes.
    std::optional<std::array<glm::vec3, 2>> sideLine(const NearestPoint& nearest, const glm::vec3& place) const {
        return core_->sideLine(nearest, place);
    }

    /// The features that are tested against a field, grown by radius(): vertices, and points along edges. Their number
    /// is constant.
    using Edge = ConvexEdge;
    std::span<const glm::vec3> vertices() const { return core_->vertices(); }
    std::span<const Edge> edges() const { return core_->edges(); }
    float radius(std::uint32_t vertex) const { return growth_ + core_->radius(vertex); }
    /// @param fraction  of the edge
    float radius(const Edge& edge, float fraction) const {
        return radius(edge.from) + fraction * (radius(edge.to) - radius(edge.from));
    }
    glm::vec3 place(const Edge& edge, float fraction) const { return core_->place(edge, fraction); }

  private:
    Convex(std::shared_ptr<const ConvexCore> core, float growth) : core_(std::move(core)), growth_(growth) {}

    std::shared_ptr<const ConvexCore> core_;
    float growth_;  ///< [m]
};

}  // namespace bilayer::detail
