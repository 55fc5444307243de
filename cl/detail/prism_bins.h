// Prisms around triangles, and which of them reach which block: what the host prepares for the prism method.
//
// C. Sigg, R. Peikert, M. Gross, "Signed distance transform using graphics hardware", IEEE Visualization 2003. The
// prism of a triangle is as high as the band on both sides, and its three side planes halve the angles to the
// neighbours across its edges: one polyhedron a triangle, that stands for the Voronoi cell of the face and for parts of
// those of its edges and vertices. Around a vertex of more than three edges the side planes do not meet in one line, so
// that prisms overlap there or leave gaps; and those of triangles narrower than the band may close below it. That is
// the method's leak.
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

/// A prism in the frame (u, n x u, n) of its triangle, with corner 0 in the origin, corner 1 on u and n to the outside.
/// Edge k runs from corner k to the next one. Lengths are in voxels, voxels are counted from the first of the brick. As
/// in prism.cl.
struct Prism {
    glm::vec3 u, n;          ///< axes
    glm::vec3 origin;        ///< the brick's first voxel, in the frame
    glm::vec3 lower, upper;  ///< a box around the part of the prism within reach of the triangle
    float length;            ///< of edge 0, the longest
    glm::vec2 apex;          ///< corner 2, in the frame
    glm::vec2 lean[3];       ///< a point is on this side of edge k if lean.x * (its depth behind the edge) + lean.y *
                             ///< (its height) >= 0; zero where no two triangles share the edge: no plane ends it there
    std::int32_t triangle;   ///< index into Mesh::triangles
};
static_assert(sizeof(Prism) == 25 * sizeof(float));

/// For each edge of each triangle (edge k runs from corner k to the next one) the vertex across it, of the one other
/// triangle that shares it; `none` where there is no other one, or several. Throws Cancelled.
struct VerticesAcross {
    static constexpr std::uint32_t none = ~0u;

    VerticesAcross(const Mesh& mesh, Progress& progress);

    std::vector<glm::uvec3> ofTriangle;
};

/// What prisms are made from.
struct PrismJob {
    const Mesh& mesh;
    const VerticesAcross& across;
    double voxelsPerUnit;
    float reach;  ///< height of the prisms [voxels]
};

/// The prisms and blocks of a brick.
struct PrismBlocks {
    std::vector<Prism> prisms;            ///< by triangle; those that reach a block
    std::vector<glm::ivec3> places;       ///< each block's first voxel, from that of the brick
    std::vector<std::uint32_t> offsets;   ///< prisms of block b: reaching[offsets[b]] .. reaching[offsets[b + 1]]
    std::vector<std::uint32_t> reaching;  ///< indices into `prisms`, ascending in each block

    struct Pair {
        std::uint32_t block, prism;
    };
    std::vector<Pair> pairs;             ///< scratch of binPrisms()
    std::vector<std::uint32_t> cursors;  ///< likewise
};

/// Makes the prisms of a brick's triangles and bins them into its blocks; a triangle without an area has none. `blocks`
/// is overwritten; its memory is used again.
void binPrisms(const PrismJob& job, const TriangleBins& bins, std::size_t brick, PrismBlocks& blocks);

}  // namespace bilayer::detail
