// The normals of a mesh's edges and vertices: J. A. Baerentzen, H. Aanaes, "Signed distance computation using the angle
// weighted pseudonormal", IEEE TVCG 11 (2005) 243-253. Vertices count as one if their coordinates are equal, triangles
// that repeat another count once, and those without area not at all.
#pragma once

#include <hwy/cache_control.h>

#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include <bilayer/sdf/mesh.h>

namespace bilayer::detail {

/// Means of the unit normals around edges and vertices, weighted by angles: as long as 1 where the surface is flat,
/// next to nothing where normals cancel out and tell no side. Zero as well beside triangles without area, which hide
/// from their neighbours who else is there.
class FeatureNormals {
  public:
    FeatureNormals() = default;

    /// @param mesh      valid
    /// @param thinnest  triangles thinner than this have no area [m]
    FeatureNormals(const Mesh& mesh, double thinnest);

    /// Of the edge from a corner (0..2) of a triangle to the next.
    const glm::vec3& ofEdge(std::uint32_t triangle, int edge) const { return edges_[3 * std::size_t(triangle) + edge]; }
    /// Asks for the memory of a triangle's edges ahead of its use.
    void fetchEdges(std::uint32_t triangle) const { hwy::Prefetch(&edges_[3 * std::size_t(triangle)]); }
    /// Of a point of the mesh.
    const glm::vec3& ofVertex(std::uint32_t point) const { return vertices_[point]; }
    /// Whether a triangle has no normal: it has no area, or another one is its back.
    bool isFlat(std::uint32_t triangle) const;

    std::size_t memoryBytes() const;

  private:
    std::vector<glm::vec3> edges_, vertices_;
    std::vector<std::uint32_t> flat_;  // in ascending order
};

}  // namespace bilayer::detail
