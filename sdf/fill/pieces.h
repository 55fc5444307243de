// SPDX-License-Identifier: Apache-2.0
// Cuts triangles into pieces of about one voxel, each with a sample and a covering radius around the sample. The
// samples select the pieces that can be nearest to a voxel, and the pieces give the distance. This is the sampling of
// the double layer method with both layers on the surface (delta = 0). The covering radius makes the selection provably
// sufficient: the sample of the nearest piece lies within its radius plus any upper bound of the distance.
// Tested by tests/sdf/exact.cpp through build().
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <vector>

#include "sdf/fill/triangle_limits.h"

namespace bilayer::detail {

/// A piece in its local frame. The longest edge runs from the origin along `u`, and the third corner lies on the side
/// of `w`. All values derive from the differences between the corners and a nearby lattice point. Distances therefore
/// do not depend on the block or brick, and floats resolve them to 1e-6 voxels at any distance from the mesh origin.
struct Piece {
    glm::ivec3 base;   ///< a voxel near the piece [index coordinates]
    glm::vec3 origin;  ///< one end of the longest edge, from `base` [voxels]
    glm::vec3 u, w,
        n;         ///< unit vectors: along the longest edge, perpendicular to it in the plane, normal (either side)
    float length;  ///< of the longest edge [voxels]
    float ox, oy, olen;  ///< unit vector from the origin to the third corner in (u, w), and the length [voxels]
    float ex, ey, elen;  ///< the same from the other end of the longest edge
    glm::vec3 sample;    ///< a point of the piece, from `base` [voxels]
    float radius;        ///< maximum distance of a point of the piece from the sample [voxels]
    std::uint32_t triangle;
};

/// Cuts triangles into pieces.
class PieceCutter {
  public:
    /// @param maxEdge  maximum edge length of a piece [voxels]
    /// @param pieces   receives the pieces
    PieceCutter(double maxEdge, std::vector<Piece>& pieces) : maxEdge2_(maxEdge * maxEdge), pieces_(pieces) {}

    /// Cuts a triangle by bisecting longest edges, and discards pieces whose box misses the limits. Pieces do not
    /// depend on the limits. The pieces of two triangles meet at the same points of a shared edge.
    void cut(const TriangleCorners& corners, std::uint32_t triangle, const TriangleLimits& limits) {
        const TriangleCorners& c = corners;
        // Most triangles of a fine mesh are short. A function call for each would double the cost.
        if (longestEdge2(c) <= maxEdge2_)
            add(c[0], c[1] - c[0], c[2] - c[0], triangle);
        else
            halve(c, triangle, limits);
    }

    /// Processes the remaining pieces of the last batch. Call it after the last triangle.
    void finish();

    /// Batch size of the SIMD code.
    static constexpr int batch = 16;

    /// A batch of pieces to process: a lattice point, a corner relative to it, the vectors from there to the other
    /// corners.
    struct WaitingPieces {
        std::array<glm::ivec3, batch> base;
        std::array<std::uint32_t, batch> triangle;
        alignas(64) float corner[3][batch];
        alignas(64) float ab[3][batch];
        alignas(64) float ac[3][batch];
    };

  private:
    void add(const glm::dvec3& corner, const glm::dvec3& ab, const glm::dvec3& ac, std::uint32_t triangle) {
        const auto at = std::size_t(count_);
        const glm::ivec3 base(roundToInt(corner.x), roundToInt(corner.y), roundToInt(corner.z));
        waiting_.base[at] = base;
        waiting_.triangle[at] = triangle;
        for (int axis = 0; axis < 3; ++axis) {
            waiting_.corner[axis][at] = float(corner[axis] - double(base[axis]));
            waiting_.ab[axis][at] = float(ab[axis]);
            waiting_.ac[axis][at] = float(ac[axis]);
        }
        if (++count_ == batch) finish();
    }
    void halve(const TriangleCorners& corners, std::uint32_t triangle, const TriangleLimits& limits);

    // Rounds to nearest with halves up, so that a shift by whole voxels shifts the result. Valid for |value| < 2^31.
    static int roundToInt(double value) {
        constexpr double shift = 2147483648.0;
        return int(std::int64_t(value + 0.5 + shift) - std::int64_t(shift));
    }

    double maxEdge2_;
    std::vector<Piece>& pieces_;
    WaitingPieces waiting_{};
    int count_ = 0;
};

}  // namespace bilayer::detail
