// Bullet's convex shapes by formula: distance, and the points of theirs that a field must be asked about.
#pragma once

#include <BulletCollision/CollisionShapes/btConvexShape.h>

#include <functional>
#include <vector>

#include "sdf/mesh.h"

namespace bilayer::bullet {

/// A convex shape as a core (segment, box, solid of revolution, hull) grown by a radius. In the coordinates of the
/// btConvexShape, with its scaling and margin, in metres. Spheres, capsules, boxes, cylinders and cones are exact;
/// hulls and unknown shapes are hulls of their (support) points, grown by Bullet's margin as everywhere in Bullet.
class Convex {
  public:
    explicit Convex(const btConvexShape& shape);

    /// False once the shape has been scaled or given another margin.
    bool isOf(const btConvexShape& shape) const;

    struct Near {
        float distance;    ///< signed, to the surface [m]
        glm::vec3 normal;  ///< of the surface there, outward, of unit length
        glm::vec3 core;    ///< nearest point of the core's surface
    };
    /// Outside of a hull and farther than `reach`, only a lower bound of the distance.
    Near nearest(const glm::vec3& point, float reach) const;

    /// True where surface points of a field alone would miss the deepest place of the round surface between them.
    bool isCurved() const { return core_ != Core::box; }
    /// The point of the surface around `near` that lies farthest in a direction of unit length.
    glm::vec3 slide(const Near& near, const glm::vec3& direction) const;

    /// How far the shape reaches beyond its probes in every direction [m].
    float radius() const { return radius_; }
    /// Visits corners, and points along the edges that lie within a sphere, at most about `spacing` apart.
    /// @param visit  (point of the core, a number that stays the same from step to step)
    void visitProbes(const glm::vec3& centre, float within, float spacing,
                     const std::function<void(const glm::vec3&, std::uint32_t)>& visit) const;

  private:
    enum class Core { segment, box, revolution, hull };
    struct Edge {
        std::uint32_t from, to;  ///< corners
        float rim;               ///< the radius of the circle whose chord this is, 0 for a straight edge [m]
    };
    struct Plane {
        glm::vec3 normal;
        float offset;
        std::size_t begin, end;  ///< triangles of `faces_` that lie in it
    };

    void makeRevolution(int axis, float halfHeight, float lowerRadius, float upperRadius);
    void addRim(float height, float rim);
    void makeBox(const glm::vec3& halfExtents);
    void makeHull(const std::vector<btVector3>& points);

    Near nearestOfSegment(const glm::vec3& point) const;
    Near nearestOfBox(const glm::vec3& point) const;
    Near nearestOfRevolution(const glm::vec3& point) const;
    Near nearestOfHull(const glm::vec3& point, float reach) const;

    btVector3 scaling_;
    float margin_;
    Core core_ = Core::hull;
    float radius_ = 0;                         ///< by which the core is grown [m]
    int axis_ = 1;                             ///< of segments and solids of revolution
    float halfHeight_ = 0;                     ///< of segments and solids of revolution [m]
    glm::vec3 halfExtents_{0};                 ///< of boxes [m]
    float lowerRadius_ = 0, upperRadius_ = 0;  ///< of solids of revolution at either end [m]
    std::vector<Plane> planes_;                ///< of hulls
    Mesh faces_;                               ///< of hulls; `points` are the corners of every core
    std::vector<Edge> edges_;
};

/// The point of a triangle nearest to a point.
glm::vec3 nearestOnTriangle(const glm::vec3& point, const glm::vec3& a, const glm::vec3& b, const glm::vec3& c);

/// Visits the points that divide an edge into equal parts of at most `spacing`, ends excluded, as far as they lie
/// within a sphere; where there are too many, every second, fourth, ... of them.
/// @param visit  (point, index of the part's end)
void visitAlong(const glm::vec3& from, const glm::vec3& to, const glm::vec3& centre, float within, float spacing,
                const std::function<void(const glm::vec3&, std::uint32_t)>& visit);

}  // namespace bilayer::bullet
