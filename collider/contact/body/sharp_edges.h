// SPDX-License-Identifier: Apache-2.0
// The sharp edges of a body as segments between neighbouring surface points. Edge-edge contacts mostly lie between the
// points.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include <bilayer/collider/field.h>
#include "collider/contact/body/surface_points.h"

namespace bilayer::detail {

/// Conormals of an edge: unit vectors perpendicular to it, pointing into the faces on either side.
using Conormals = std::array<glm::vec3, 2>;

/// A segment between two sharp surface points, by their indices.
struct SharpEdge {
    std::uint32_t from, to;
    Conormals conormals;

    std::uint32_t otherEnd(std::uint32_t point) const { return from == point ? to : from; }
};

/// The sharp edges of a body, derived from its points and field alone; a body from a file thus has the same ones.
/// Segments join a sharp point to its nearest neighbour in each direction if the relation is mutual (T. K. Dey, P.
/// Kumar, "A simple provable algorithm for curve reconstruction", SODA 1999). A segment is kept only if its middle
/// lies on the field's surface.
class SharpEdges {
  public:
    SharpEdges() = default;
    SharpEdges(const SurfacePoints& points, const Field& field);

    std::span<const SharpEdge> edges() const { return edges_; }
    /// The indices of the edges at a point.
    std::span<const std::uint32_t> around(std::uint32_t point) const {
        if (edges_.empty()) return {};
        return {ofPoints_.data() + first_[point], ofPoints_.data() + first_[point + 1]};
    }
    float maxLength() const { return maxLength_; }  ///< [m]

    /// Whether a sharp point is a convex vertex (support vertex) in a direction: the body recedes from it on all sides,
    /// or along all edges at the point and their faces. A body that approaches along the direction hits this point
    /// first. Edges and faces perpendicular to the direction, to within about five degrees, do not recede: they are hit
    /// at the same time.
    /// @param direction  outward, of unit length
    bool isConvexVertex(const SurfacePoints& points, std::uint32_t point, const glm::vec3& direction) const;

    /// Whether a sharp point lies within an edge: its edges point in about opposite directions.
    bool isWithinEdge(const SurfacePoints& points, std::uint32_t point) const;

    struct Crossing {
        glm::vec3 position;  ///< on the edge of this body
        glm::vec3 normal;    ///< perpendicular to both edges, outward
        float distance;      ///< from here to the other edge; negative: the edges have passed each other [m]
    };
    /// Finds where an edge of another body crosses an edge of this body, nearest to a place on the other edge. Requires
    /// a plane that separates the two edges and from which all four faces recede; otherwise faces or vertices touch
    /// first. All arguments are in this body's coordinates.
    /// @param conormals  of the other edge
    /// @param place      deepest point of the other edge in the field, up to the rounding of edges by the interpolant
    /// @param distance   in the field there [m]; a much deeper crossing is rejected as an edge on another side
    std::optional<Crossing> crossing(const SurfacePoints& points, const glm::vec3& from, const glm::vec3& to,
                                     const Conormals& conormals, const glm::vec3& place, float distance,
                                     float voxelSize) const;

  private:
    bool edgesRecede(const SurfacePoints& points, std::uint32_t point, const glm::vec3& direction) const;
    /// The test for points without edges: where edges meet at acute angles, and at a rounded convex vertex.
    bool pointsRecede(const SurfacePoints& points, std::uint32_t point, const glm::vec3& direction) const;

    std::vector<SharpEdge> edges_;
    std::vector<std::uint32_t> first_, ofPoints_;
    float maxLength_ = 0, maxDepthFactor_ = 0, maxExcessDepth_ = 0, neighbourDistance_ = 0;
};

}  // namespace bilayer::detail
