// SPDX-License-Identifier: Apache-2.0
// What a convex body grows from: the nearest point of its surface, its curvature there, and its vertices and edges.
// Tested by tests/bullet/convex.cpp through Convex.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <optional>
#include <span>
#include <vector>

#include "collider/contact/body/sharp_edges.h"
#include "collider/contact/shapes/nearest_point.h"

namespace bilayer::detail {

/// An edge of a core that is tested against a field.
struct ConvexEdge {
    std::uint32_t from, to;                ///< indices of vertices
    float rim;                             ///< radius of the circle whose chord this is; 0 for a straight edge [m]
    std::optional<Conormals> conormals{};  ///< of a straight edge between two faces
};

/// The unit vector along an axis, and one across it.
inline glm::vec3 unitAlong(int axis) {
    glm::vec3 unit(0);
    unit[axis] = 1;
    return unit;
}
inline glm::vec3 unitAcross(int axis) {
    return unitAlong((axis + 1) % 3);
}

/// A convex core, in metres. A NearestPoint that is passed in belongs to the grown body.
class ConvexCore {
  public:
    virtual ~ConvexCore() = default;
    ConvexCore(const ConvexCore&) = delete;
    ConvexCore& operator=(const ConvexCore&) = delete;

    /// The nearest point of the core's surface. Beyond `reach` outside, the distance may be only a lower bound.
    virtual NearestPoint nearest(const glm::vec3& point, float reach) const = 0;
    /// Whether any part of the surface is curved.
    virtual bool isCurved() const { return true; }
    /// Whether the surface is flat at the nearest point, or is flat where the core is.
    virtual bool isFlat(const NearestPoint&) const { return false; }
    /// Whether the surface is curved and smooth there.
    virtual bool isRound(const NearestPoint&) const { return false; }
    /// The point of the core around nearest.core that is farthest in a direction of unit length.
    virtual glm::vec3 supportNear(const NearestPoint& nearest, const glm::vec3&) const { return nearest.core; }
    /// The farthest point in a direction: a vertex.
    virtual glm::vec3 support(const glm::vec3& direction) const;
    /// The ends of the generator line through a point on the side of a solid of revolution. Nothing elsewhere.
    virtual std::optional<std::array<glm::vec3, 2>> sideLine(const NearestPoint&, const glm::vec3&) const {
        return std::nullopt;
    }

    std::span<const glm::vec3> vertices() const { return vertices_; }
    std::span<const ConvexEdge> edges() const { return edges_; }
    /// The radius of the core at a vertex [m].
    virtual float radius(std::uint32_t) const { return 0; }
    /// @param fraction  of the edge
    virtual glm::vec3 place(const ConvexEdge& edge, float fraction) const;

  protected:
    ConvexCore() = default;
    /// Tolerance for rounding [m]: a thinner body has no inside, and a point no farther than this beyond a face is over
    /// it.
    /// @param growth  of the body around the core [m]
    float tolerance(float growth) const;

    std::vector<glm::vec3> vertices_;
    std::vector<ConvexEdge> edges_;
};

}  // namespace bilayer::detail
