// SPDX-License-Identifier: Apache-2.0
// Builds the prisms around triangles and bins them by the blocks that they reach: the host side of the prism method.
//
// C. Sigg, R. Peikert, M. Gross, "Signed distance transform using graphics hardware", IEEE Visualization 2003. The
// prism of a triangle extends as high as the band on both sides. Its three side planes bisect the angles to the
// neighbours across its edges. One polyhedron per triangle thus covers the Voronoi cell of the face and parts of the
// cells of its edges and vertices.
//
// The method leaks. Around a vertex of more than three edges the side planes do not meet in one line, so the prisms
// overlap there or leave gaps. The prisms of triangles narrower than the band may close below its full height.
// Tested by tests/cl/prism.cpp.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include <bilayer/sdf/mesh.h>
#include "sdf/fill/triangle_bins.h"

namespace bilayer::detail {

/// A prism in the frame (u, n x u, n) of its triangle: vertex 0 is the origin, vertex 1 is on u, and n points outward.
/// Edge k runs from vertex k to the next one. Lengths are in voxels; voxels are counted from the first of the brick.
/// Same layout as in prism.cl.
struct Prism {
    glm::vec3 u, n;          ///< axes
    glm::vec3 origin;        ///< the brick's first voxel, in the frame
    glm::vec3 lower, upper;  ///< bounding box of the part of the prism within reach of the triangle
    float length;            ///< of edge 0, the longest
    glm::vec2 apex;          ///< vertex 2, in the frame
    /// The side plane at edge k: the prism is where sideNormal.x * (depth behind the edge) + sideNormal.y * (height) >=
    /// 0. Zero where no two triangles share the edge: no plane ends the prism there.
    glm::vec2 sideNormal[3];
    std::int32_t triangle;  ///< index into Mesh::triangles
};
static_assert(sizeof(Prism) == 25 * sizeof(float));

/// For each edge of each triangle, the opposite vertex of the one other triangle that shares the edge. `none` if no
/// other triangle shares it, or several do. Edge k runs from vertex k to the next one. Throws Cancelled.
struct VerticesAcross {
    static constexpr std::uint32_t none = ~0u;

    VerticesAcross(const Mesh& mesh, Progress& progress);

    std::vector<glm::uvec3> ofTriangle;
};

/// Input of the prisms.
struct PrismJob {
    const Mesh& mesh;
    const VerticesAcross& across;
    double voxelsPerUnit;
    float reach;  ///< height of the prisms [voxels]
};

/// The prisms and blocks of a brick.
struct PrismBlocks {
    std::vector<Prism> prisms;            ///< sorted by triangle; only those that reach a block
    std::vector<glm::ivec3> places;       ///< first voxel of each block, relative to the brick's
    std::vector<std::uint32_t> offsets;   ///< prisms of block b: reaching[offsets[b]] .. reaching[offsets[b + 1]]
    std::vector<std::uint32_t> reaching;  ///< indices into `prisms`, ascending in each block

    struct Pair {
        std::uint32_t block, prism;
    };
    std::vector<Pair> pairs;             ///< scratch of binPrisms()
    std::vector<std::uint32_t> cursors;  ///< likewise
};

/// Makes the prisms of a brick's triangles and bins them into its blocks. A triangle without an area has none.
/// Overwrites `blocks` and reuses its memory.
void binPrisms(const PrismJob& job, const TriangleBins& bins, std::size_t brick, PrismBlocks& blocks);

}  // namespace bilayer::detail
