// SPDX-License-Identifier: Apache-2.0
// Open surfaces: two-sided triangles, which a callback passes one at a time. Edges with equal end points are one edge.
// Tested by tests/bullet/open_surface.cpp through collideTriangles().
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <optional>
#include <span>
#include <vector>

#include <bilayer/collider/shapes.h>

#include "collider/contact/body/sharp_edges.h"
#include "sdf/base/finite.h"

namespace bilayer::detail {

/// The conormal of an edge: in the triangle's plane, from an edge into the triangle, of unit length. The edge runs
/// from that vertex to the next. Zero if the triangle has no area.
glm::vec3 conormalOf(const Triangle& triangle, int edge);

inline bool isFinite(const Triangle& triangle) {
    return isFinite(triangle[0]) && isFinite(triangle[1]) && isFinite(triangle[2]);
}

/// Adjacency of triangles by edge and vertex. Features are shared if their coordinates are equal to the bit. Edge i of
/// a triangle runs from its vertex i to the next one.
class Adjacency {
  public:
    struct Member {
        std::uint32_t triangle;
        int index;  ///< of its edge or vertex
    };

    /// @param triangles  must outlive this
    explicit Adjacency(std::span<const Triangle> triangles);

    /// The triangles at an edge, including this one, in ascending order.
    std::span<const Member> atEdge(std::uint32_t triangle, int edge) const { return groupOf(edges_, triangle, edge); }
    /// The conormals of an edge that exactly two triangles share.
    std::optional<Conormals> conormalsOf(std::uint32_t triangle, int edge) const;
    /// The other triangle's conormal.
    std::optional<glm::vec3> neighbourOf(std::uint32_t triangle, int edge) const;

    /// The unit vector nearest to a direction in the normal cone of an edge or vertex. The normal cone holds the
    /// directions in which the feature is the closest point of its triangles. Nothing if the nearest one is more than
    /// 60 degrees away.
    std::optional<glm::vec3> edgeNormal(std::uint32_t triangle, int edge, const glm::vec3& direction) const;
    std::optional<glm::vec3> vertexNormal(std::uint32_t triangle, int vertex, const glm::vec3& direction) const;

  private:
    /// Edges or vertices, grouped by equal coordinates.
    struct Groups {
        std::vector<Member> members;
        std::vector<std::uint32_t> first, end;  ///< range of the group of each triangle's edges or vertices
    };
    std::span<const Member> groupOf(const Groups& groups, std::uint32_t triangle, int index) const {
        const std::size_t at = 3 * std::size_t(triangle) + std::size_t(index);
        return {groups.members.data() + groups.first[at], groups.members.data() + groups.end[at]};
    }
    template <class KeyOf>
    Groups groupBy(KeyOf&& keyOf) const;

    std::span<const Triangle> triangles_;
    Groups edges_, vertices_;
};

/// The sharp features of an open surface: its border, and folds of more than 30 degrees.
struct SharpFeatures {
    struct OutwardEdge {
        glm::vec3 from, to;
        glm::vec3 outward;  ///< away from the surface, of unit length
    };
    struct OutwardVertex {
        glm::vec3 place, outward;
    };
    std::vector<OutwardEdge> edges;
    std::vector<OutwardVertex> vertices;
};
SharpFeatures sharpFeaturesOf(std::span<const Triangle> triangles);

/// The triangles of an open surface that a sphere may touch along a polyline, each once.
std::vector<Triangle> trianglesAlong(const OpenSurface& openSurface, std::span<const glm::vec3> path, float radius);

}  // namespace bilayer::detail
