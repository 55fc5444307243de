// SPDX-License-Identifier: Apache-2.0
// The pseudonormals of a mesh's edges and vertices: J. A. Baerentzen, H. Aanaes, "Signed distance computation using the
// angle weighted pseudonormal", IEEE TVCG 11 (2005) 243-253. Vertices with equal coordinates count as one. Duplicate
// triangles count once, and triangles without area are ignored.
// Tested by tests/collider/field_closest.cpp through Field::closest().
#pragma once

#include <hwy/cache_control.h>

#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include <bilayer/sdf/mesh.h>

namespace bilayer::detail {

/// Min length of a mean of unit normals. The normals of a shorter mean have cancelled out or are unknown, and define no
/// side for oblique directions. The limit is above the rounding of floats, and below the length at the tips of needles.
inline constexpr double minMeanNormal = 1e-6;

/// Angle-weighted means of the unit normals around edges and vertices. The length is 1 where the surface is flat, and
/// close to zero where normals cancel out and define no side. It is also zero next to triangles without area, because
/// these hide the neighbours of an edge from each other.
class FeatureNormals {
  public:
    FeatureNormals() = default;

    /// @param mesh      valid
    /// @param thinnest  triangles thinner than this count as having no area [m]
    FeatureNormals(const Mesh& mesh, double thinnest);

    /// The pseudonormal of the edge from a corner (0..2) of a triangle to the next.
    const glm::vec3& ofEdge(std::uint32_t triangle, int edge) const { return edges_[3 * std::size_t(triangle) + edge]; }
    /// Prefetches the normals of a triangle's edges.
    void fetchEdges(std::uint32_t triangle) const { hwy::Prefetch(&edges_[3 * std::size_t(triangle)]); }
    /// The pseudonormal of a point of the mesh.
    const glm::vec3& ofVertex(std::uint32_t point) const { return vertices_[point]; }
    /// Whether a triangle has no normal: it has no area, or another triangle is its reverse.
    bool hasNoNormal(std::uint32_t triangle) const;

    std::size_t memoryBytes() const;

  private:
    std::vector<glm::vec3> edges_, vertices_;
    std::vector<std::uint32_t> flat_;  // in ascending order
};

}  // namespace bilayer::detail
