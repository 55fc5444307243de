// Triangles cut into pieces of about a voxel, each with a sample and the radius around it that covers the piece. The
// samples tell which pieces can be nearest to a voxel; the pieces say how near. This is the double layer method's
// sampling with both layers on the surface (delta = 0), where the covering radius makes the choice of pieces provably
// sufficient: the nearest piece has its sample within its radius plus any upper bound of the distance.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

namespace bilayer {

/// Corners of a triangle or of a part of one [voxels].
using PieceCorners = std::array<glm::dvec3, 3>;

/// A piece in a frame of its own: the longest edge runs from the origin along `u`, the third corner lies on the side of
/// `w`. All numbers follow from the corners' differences to a lattice point beside them, so distances do not depend on
/// which block or brick asks, and floats hold them to 1e-6 voxels however far the mesh is from the origin.
struct Piece {
    glm::ivec3 base;     ///< a voxel near the piece [index coordinates]
    glm::vec3 origin;    ///< one end of the longest edge, from `base` [voxels]
    glm::vec3 u, w, n;   ///< unit vectors: along the longest edge, across it in the plane, normal (either side)
    float length;        ///< of the longest edge [voxels]
    float ox, oy, olen;  ///< unit vector from the origin to the third corner in (u, w), and the length [voxels]
    float ex, ey, elen;  ///< the same from the longest edge's other end
    glm::vec3 sample;    ///< a point of the piece, from `base` [voxels]
    float radius;        ///< no point of the piece is farther from the sample [voxels]
    std::uint32_t triangle;
};

/// A box in index coordinates [voxels].
struct PieceLimits {
    glm::dvec3 lower, upper;
};

/// Cuts a triangle into pieces with edges of at most `longestEdge` [voxels] by halving longest edges, and appends those
/// whose box meets the limits. The pieces do not depend on the limits, and those of two triangles meet at the same
/// points of a shared edge.
void cutTriangle(const PieceCorners& corners, std::uint32_t triangle, double longestEdge, const PieceLimits& limits,
                 std::vector<Piece>& pieces);

}  // namespace bilayer
