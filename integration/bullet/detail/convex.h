// Bullet's convex shapes by formula: distance, and the points of theirs that a field must be asked about.
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

/// A convex shape as a core (segment, box, solid of revolution, hull of points or balls) grown by a radius. In the
/// coordinates of the btConvexShape, with its scaling and margin, in metres. Spheres, capsules, boxes, cylinders, cones
/// and multispheres are exact, whatever the margin; hulls and unknown shapes are hulls of their (support) points, grown
/// by Bullet's margin as everywhere in Bullet.
class Convex {
  public:
    explicit Convex(const btConvexShape& shape);

    /// False for another shape, and once the shape has been scaled, resized or given another margin or more points.
    bool isOf(const btConvexShape& shape) const;

    struct Near {
        float distance;    ///< signed, to the surface [m]
        glm::vec3 normal;  ///< of the surface there, outward, of unit length
        glm::vec3 core;    ///< nearest point of the core's surface
        float radius;      ///< by which the core is grown there [m]
    };
    /// Outside of a hull and farther than `reach`, only a lower bound of the distance.
    Near nearest(const glm::vec3& point, float reach) const;

    struct Entry {
        float part;  ///< of the way, at which it comes within the tolerance
        Near near;   ///< there
    };
    /// Where a straight way comes to the body; where it begins if that is inside.
    /// @param tolerance  how near counts [m]
    std::optional<Entry> enter(const glm::vec3& start, const glm::vec3& way, float tolerance) const;

    /// True where surface points of a field alone would miss the deepest place of the round surface between them.
    bool isCurved() const { return core_ != Core::box; }
    /// The point of the surface around `near` that lies farthest in a direction of unit length.
    glm::vec3 slide(const Near& near, const glm::vec3& direction) const;

    /// Whether the surface is flat where a point is near it, or is where its core's is.
    bool isFlat(const Near& near) const;
    /// Whether it is round and smooth there.
    bool isRound(const Near& near) const;
    /// The ends of the straight line on a solid of revolution's side that runs through a place; nothing on its flat
    /// ends, and for other shapes.
    std::optional<std::array<glm::vec3, 2>> sideLine(const Near& near, const glm::vec3& place) const;

    /// What is asked about in a field, grown by radius(): corners, and places along edges. Their numbers stay the same.
    struct Edge {
        std::uint32_t from, to;  ///< corners
        float rim;               ///< the radius of the circle whose chord this is, 0 for a straight edge [m]
        std::optional<Conormals> conormals{};  ///< of a straight edge between two faces
    };
    std::span<const glm::vec3> corners() const { return faces_.points; }
    std::span<const Edge> edges() const { return edges_; }
    float radius(std::uint32_t corner) const { return radii_.empty() ? radius_ : radii_[corner]; }
    /// @param part  of the way along the edge
    float radius(const Edge& edge, float part) const;
    glm::vec3 place(const Edge& edge, float part) const;

  private:
    enum class Core { segment, box, revolution, balls, hull };
    struct Plane {
        glm::vec3 normal;
        float offset;
        std::size_t begin, end;  ///< triangles of `faces_` that lie in it

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

    const btConvexShape* shape_;  ///< only to tell it from others
    btVector3 scaling_;
    float margin_;
    int vertices_;
    std::array<btVector3, 2> bounds_;
    Core core_ = Core::hull;
    float radius_ = 0;                         ///< by which the core is grown; the largest of balls' [m]
    int axis_ = 1;                             ///< of segments and solids of revolution
    float halfHeight_ = 0;                     ///< of segments and solids of revolution [m]
    glm::vec3 halfExtents_{0};                 ///< of boxes [m]
    float lowerRadius_ = 0, upperRadius_ = 0;  ///< of solids of revolution at either end [m]
    std::vector<Plane> planes_;                ///< of hulls
    bool isFlat_ = false;                      ///< a hull of points in one plane, which nothing is inside of
    Mesh faces_;                               ///< of hulls; `points` are the corners of every core
    /// The planes around corner i of a hull are planesAround_[j] with firstAround_[i] <= j < firstAround_[i + 1].
    std::vector<std::uint32_t> firstAround_, planesAround_;
    std::vector<Edge> edges_;
    MultisphereHull balls_;
    std::vector<float> radii_;  ///< of balls: of corners [m]
};

/// How far apart the places along an edge are that a field is asked about [voxels]: like its own surface points.
inline constexpr float probeSpacing = 2;

/// Into how many parts such places divide an edge, at least one. Lengths in one unit, whichever.
int probeParts(float length, float voxelSize, int most);

/// The point of a triangle nearest to a point.
glm::vec3 nearestOnTriangle(const glm::vec3& point, const glm::vec3& a, const glm::vec3& b, const glm::vec3& c);

}  // namespace bilayer::bullet::detail
