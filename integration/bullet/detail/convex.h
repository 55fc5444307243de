// SPDX-License-Identifier: Apache-2.0
// Bullet's convex shapes in closed form: signed distance, and the features to be tested against a field.
#pragma once

#include <BulletCollision/CollisionShapes/btConvexShape.h>
#include <BulletCollision/CollisionShapes/btMultiSphereShape.h>

#include <array>
#include <glm/geometric.hpp>
#include <optional>
#include <span>
#include <vector>

#include <bilayer/sdf/mesh.h>
#include "collider/contact/sharp_edges.h"
#include "integration/bullet/detail/multisphere.h"
#include "integration/bullet/detail/nearest_point.h"

namespace bilayer::bullet::detail {

using namespace bilayer::detail;

/// A convex shape as a core (segment, box, solid of revolution, hull of points or spheres) grown by a radius.
/// Coordinates are those of the btConvexShape, with its scaling and margin, in metres. Spheres, capsules, boxes,
/// cylinders, cones and multispheres are exact for any margin. Hulls and unknown shapes are hulls of their (support)
/// points, grown by Bullet's margin as everywhere in Bullet.
class Convex {
  public:
    explicit Convex(const btConvexShape& shape);

    /// Whether this object represents the shape. False for another shape, and after the shape has changed its scaling,
    /// size, margin or number of points.
    bool represents(const btConvexShape& shape) const;

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
    bool isCurved() const { return core_ != Core::box; }
    /// The point of the surface around its nearest point that is farthest in a direction of unit length.
    glm::vec3 supportNear(const NearestPoint& nearest, const glm::vec3& direction) const;

    /// Whether the surface is flat at the nearest point, or is flat where its core is.
    bool isFlat(const NearestPoint& nearest) const;
    /// Whether the surface is curved and smooth there.
    bool isRound(const NearestPoint& nearest) const;
    /// The ends of the generator line through a point on the side of a solid of revolution. Nothing on its flat ends,
    /// and for other shapes.
    std::optional<std::array<glm::vec3, 2>> sideLine(const NearestPoint& nearest, const glm::vec3& place) const;

    /// The features that are tested against a field, grown by radius(): vertices, and points along edges. Their number
    /// is constant.
    struct Edge {
        std::uint32_t from, to;                ///< indices of vertices
        float rim;                             ///< radius of the circle whose chord this is; 0 for a straight edge [m]
        std::optional<Conormals> conormals{};  ///< of a straight edge between two faces
    };
    std::span<const glm::vec3> vertices() const { return mesh_.points; }
    std::span<const Edge> edges() const { return edges_; }
    float radius(std::uint32_t vertex) const { return radii_.empty() ? radius_ : radii_[vertex]; }
    /// @param fraction  of the edge
    float radius(const Edge& edge, float fraction) const;
    glm::vec3 place(const Edge& edge, float fraction) const;

  private:
    /// Tolerance for rounding [fractions of the size]. A thinner body has no inside, and a point no farther than this
    /// beyond a face is over it.
    static constexpr float flatness = 1e-6f;

    enum class Core { segment, box, revolution, spheres, hull };
    struct HullFace {
        glm::vec3 normal;
        float offset;
        std::size_t begin, end;  ///< triangles of `mesh_` in this face

        float height(const glm::vec3& point) const { return glm::dot(normal, point) - offset; }
    };

    static glm::vec3 direction(int axis) {
        glm::vec3 unit(0);
        unit[axis] = 1;
        return unit;
    }
    float size() const { return bounds_[0].distance(bounds_[1]); }

    void makeRevolution(int axis, float halfHeight, float lowerRadius, float upperRadius);
    void addRim(float height, float rim);
    void makeBox(const glm::vec3& halfExtents);
    void makeHull(const std::vector<btVector3>& points);
    void listFacesAround();
    void makeSpheres(const btMultiSphereShape& shape);

    NearestPoint nearestOfSegment(const glm::vec3& point) const;
    NearestPoint nearestOfBox(const glm::vec3& point) const;
    NearestPoint nearestOfRevolution(const glm::vec3& point) const;
    NearestPoint nearestOfHull(const glm::vec3& point, float reach) const;

    const btConvexShape* shape_;  ///< only compared, not dereferenced
    btVector3 scaling_;
    float margin_;
    int vertexCount_;
    std::array<btVector3, 2> bounds_;
    Core core_ = Core::hull;
    float radius_ = 0;                         ///< growth of the core; for spheres the largest radius [m]
    int axis_ = 1;                             ///< of segments and solids of revolution
    float halfHeight_ = 0;                     ///< of segments and solids of revolution [m]
    glm::vec3 halfExtents_{0};                 ///< of boxes [m]
    float lowerRadius_ = 0, upperRadius_ = 0;  ///< of solids of revolution, at the two ends [m]
    std::vector<HullFace> faces_;              ///< of hulls
    bool isFlat_ = false;                      ///< a hull of coplanar points, which has no inside
    Mesh mesh_;                                ///< of hulls; `points` are the vertices of every core
    /// The faces around vertex i of a hull are facesAround_[j] with firstAround_[i] <= j < firstAround_[i + 1].
    std::vector<std::uint32_t> firstAround_, facesAround_;
    std::vector<Edge> edges_;
    MultisphereHull sphereHull_;
    std::vector<float> radii_;  ///< of spheres: at the vertices [m]
};

}  // namespace bilayer::bullet::detail
