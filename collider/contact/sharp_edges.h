// The sharp edges of a body as pieces between neighbouring surface points: where two bodies touch edge on edge, they
// mostly do so between the points.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include <bilayer/collider/field.h>
#include "collider/contact/surface_points.h"

namespace bilayer::detail {

/// Directions from an edge into the faces on either side, square to it, of unit length.
using Conormals = std::array<glm::vec3, 2>;

/// Between two sharp surface points, by their indices.
struct SharpEdge {
    std::uint32_t from, to;
    Conormals conormals;
};

/// Found from the points and the field alone, so that a body from a file has the same. Pieces join each sharp point to
/// its nearest neighbours, one in each direction, where it is that one's neighbour as well (T. K. Dey, P. Kumar, "A
/// simple provable algorithm for curve reconstruction", SODA 1999), and the field has the middle between the two on the
/// surface.
class SharpEdges {
  public:
    SharpEdges() = default;
    SharpEdges(const SurfacePoints& points, const Field& field);

    std::span<const SharpEdge> edges() const { return edges_; }
    /// The indices of the edges that end in a point.
    std::span<const std::uint32_t> around(std::uint32_t point) const {
        if (edges_.empty()) return {};
        return {ofPoints_.data() + first_[point], ofPoints_.data() + first_[point + 1]};
    }
    float longest() const { return longest_; }  ///< [m]

    /// Whether the body falls back from a sharp point on all sides, or on all edges that end in it and their faces:
    /// what comes against it meets this point first. What is square to the direction, to within about five degrees, is
    /// met at once.
    /// @param direction  outward, of unit length
    bool isConvexVertex(const SurfacePoints& points, std::uint32_t point, const glm::vec3& direction) const;

    /// Whether a sharp point lies within an edge: the edges that end in it go about opposite ways.
    bool isWithinEdge(const SurfacePoints& points, std::uint32_t point) const;

    struct Crossing {
        glm::vec3 position;  ///< on the edge of this body
        glm::vec3 normal;    ///< across both edges, outward
        float distance;      ///< from here to the other edge, negative where they have passed each other [m]
    };
    /// Where another body's edge crosses one of this body's, nearest to a place on it, if there is a plane between the
    /// two that all four faces leave: else faces or corners touch first. All in this body's coordinates.
    /// @param conormals     of the other edge
    /// @param place     the deepest on it that the field shows, by the interpolant to within edges that it rounds off
    /// @param distance  that the field shows there [m]: what is much deeper is no touch, but an edge on another side
    std::optional<Crossing> crossing(const SurfacePoints& points, const glm::vec3& from, const glm::vec3& to,
                                     const Conormals& conormals, const glm::vec3& place, float distance,
                                     float voxelSize) const;

  private:
    bool edgesFallBack(const SurfacePoints& points, std::uint32_t point, const glm::vec3& direction) const;
    /// Where edges meet at sharp angles, and on a round body's tip, no edges end.
    bool pointsFallBack(const SurfacePoints& points, std::uint32_t point, const glm::vec3& direction) const;

    std::vector<SharpEdge> edges_;
    std::vector<std::uint32_t> first_, ofPoints_;
    float longest_ = 0, deepestAcross_ = 0, deepestUnseen_ = 0, nearby_ = 0;
};

}  // namespace bilayer::detail
