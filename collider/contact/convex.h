// SPDX-License-Identifier: Apache-2.0
// Convex bodies in closed form: signed distance, and the features to be tested against a field.
// Tested by tests/bullet/convex.cpp and tests/collider/shapes.cpp.
#pragma once

#include <array>
#include <cstdint>
#include <glm/geometric.hpp>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include <bilayer/sdf/mesh.h>
#include "collider/contact/multisphere.h"
#include "collider/contact/nearest_point.h"
#include "collider/contact/sharp_edges.h"

namespace bilayer::detail {

/// The surface of a convex hull.
struct HullSurface {
    std::vector<glm::vec3> points;                  ///< the vertices of the hull [m]
    std::vector<std::vector<std::uint32_t>> faces;  ///< polygons, counter-clockwise from outside
    std::vector<std::pair<std::uint32_t, std::uint32_t>> edges;
};

/// A convex body as a core (segment, box, solid of revolution, hull of points or spheres) grown by a radius, in metres.
/// Segments and solids of revolution are centred at the origin.
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
    bool isCurved() const { return core_ != Core::box; }
    /// The point of the surface around its nearest point that is farthest in a direction of unit length.
    glm::vec3 supportNear(const NearestPoint& nearest, const glm::vec3& direction) const;
    /// The farthest point in a direction of a body that is this one without its growth().
    glm::vec3 support(const glm::vec3& direction) const;
    /// 0 for spheres, whose radii differ [m].
    float growth() const { return radii_.empty() ? radius_ : 0; }

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

    Convex(Core core, float radius) : core_(core), radius_(radius) {}

    static glm::vec3 direction(int axis) {
        glm::vec3 unit(0);
        unit[axis] = 1;
        return unit;
    }
    void addRim(float height, float rim);
    void addFaces(const HullSurface& surface);
    void addHullEdges(const HullSurface& surface);
    void listFacesAround();
    void measure();

    bool isRounded(const NearestPoint& nearest) const;
    NearestPoint nearestOfSegment(const glm::vec3& point) const;
    NearestPoint nearestOfBox(const glm::vec3& point) const;
    NearestPoint nearestOfRevolution(const glm::vec3& point) const;
    NearestPoint nearestOfHull(const glm::vec3& point, float reach) const;

    Core core_;
    float radius_;                             ///< growth of the core; for spheres the largest radius [m]
    float size_ = 0;                           ///< diagonal of the bounding box [m]
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

}  // namespace bilayer::detail
