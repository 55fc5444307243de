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
    bool isOf(const btConvexShape& shape) const;

    struct Near {
        float distance;    ///< signed, to the surface [m]
        glm::vec3 normal;  ///< outward normal of the surface there, of unit length
        glm::vec3 core;    ///< nearest point on the core's surface
        float radius;      ///< growth of the core there [m]
    };
    /// The nearest point of the surface. For a hull, beyond `reach` outside, the distance is only a lower bound.
    Near nearest(const glm::vec3& point, float reach) const;

    struct Entry {
        float part;  ///< fraction of the path at which the point comes within the tolerance
        Near near;   ///< nearest point there
    };
    /// The first point of a straight path that is within the tolerance of the body; the start if that is inside.
    /// @param tolerance  [m]
    std::optional<Entry> enter(const glm::vec3& start, const glm::vec3& way, float tolerance) const;

    /// Whether the surface is curved. The surface points of a field alone would then miss the deepest point between
    /// them.
    bool isCurved() const { return core_ != Core::box; }
    /// The point of the surface around `near` that is farthest in a direction of unit length.
    glm::vec3 slide(const Near& near, const glm::vec3& direction) const;

    /// Whether the surface is flat at the nearest point, or is flat where its core is.
    bool isFlat(const Near& near) const;
    /// Whether the surface is curved and smooth there.
    bool isRound(const Near& near) const;
    /// The ends of the generator line through a point on the side of a solid of revolution. Nothing on its flat ends,
    /// and for other shapes.
    std::optional<std::array<glm::vec3, 2>> sideLine(const Near& near, const glm::vec3& place) const;

    /// The features that are tested against a field, grown by radius(): vertices, and points along edges. Their number
    /// is constant.
    struct Edge {
        std::uint32_t from, to;                ///< indices of vertices
        float rim;                             ///< radius of the circle whose chord this is; 0 for a straight edge [m]
        std::optional<Conormals> conormals{};  ///< of a straight edge between two faces
    };
    std::span<const glm::vec3> corners() const { return faces_.points; }
    std::span<const Edge> edges() const { return edges_; }
    float radius(std::uint32_t corner) const { return radii_.empty() ? radius_ : radii_[corner]; }
    /// @param part  fraction of the edge
    float radius(const Edge& edge, float part) const;
    glm::vec3 place(const Edge& edge, float part) const;

  private:
    enum class Core { segment, box, revolution, balls, hull };
    struct Plane {
        glm::vec3 normal;
        float offset;
        std::size_t begin, end;  ///< triangles of `faces_` in this plane

        float height(const glm::vec3& point) const { return glm::dot(normal, point) - offset; }
    };

    float size() const { return bounds_[0].distance(bounds_[1]); }

    void makeRevolution(int axis, float halfHeight, float lowerRadius, float upperRadius);
    void addRim(float height, float rim);
    void makeBox(const glm::vec3& halfExtents);
    void makeHull(const std::vector<btVector3>& points);
    void joinPlanes();
    void makeBalls(const btMultiSphereShape& shape);

    Near nearestOfSegment(const glm::vec3& point) const;
    Near nearestOfBox(const glm::vec3& point) const;
    Near nearestOfRevolution(const glm::vec3& point) const;
    Near nearestOfHull(const glm::vec3& point, float reach) const;

    const btConvexShape* shape_;  ///< only compared, not dereferenced
    btVector3 scaling_;
    float margin_;
    int vertices_;
    std::array<btVector3, 2> bounds_;
    Core core_ = Core::hull;
    float radius_ = 0;                         ///< growth of the core; for spheres the largest radius [m]
    int axis_ = 1;                             ///< of segments and solids of revolution
    float halfHeight_ = 0;                     ///< of segments and solids of revolution [m]
    glm::vec3 halfExtents_{0};                 ///< of boxes [m]
    float lowerRadius_ = 0, upperRadius_ = 0;  ///< of solids of revolution, at the two ends [m]
    std::vector<Plane> planes_;                ///< of hulls
    bool isFlat_ = false;                      ///< a hull of coplanar points, which has no inside
    Mesh faces_;                               ///< of hulls; `points` are the vertices of every core
    /// The planes around vertex i of a hull are planesAround_[j] with firstAround_[i] <= j < firstAround_[i + 1].
    std::vector<std::uint32_t> firstAround_, planesAround_;
    std::vector<Edge> edges_;
    MultisphereHull balls_;
    std::vector<float> radii_;  ///< of spheres: at the vertices [m]
};

/// Spacing of the probes along an edge [voxels]; the same as that of the field's surface points.
inline constexpr float probeSpacing = 2;

/// The number of intervals that the probes divide an edge into, at least 1. The lengths share any one unit.
int probeParts(float length, float voxelSize, int most);

/// The point of a triangle nearest to a point.
glm::vec3 nearestOnTriangle(const glm::vec3& point, const glm::vec3& a, const glm::vec3& b, const glm::vec3& c);

}  // namespace bilayer::bullet::detail
