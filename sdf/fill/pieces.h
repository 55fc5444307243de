// Triangles cut into pieces of about a voxel, each with a sample and the radius around it that covers the piece. The
// samples tell which pieces can be nearest to a voxel; the pieces say how near. This is the double layer method's
// sampling with both layers on the surface (delta = 0), where the covering radius makes the choice of pieces provably
// sufficient: the nearest piece has its sample within its radius plus any upper bound of the distance.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <vector>

#include "sdf/fill/triangle_limits.h"

namespace bilayer::detail {

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

/// Cuts triangles into pieces.
class PieceCutter {
  public:
    /// @param longestEdge  no piece has a longer edge than this [voxels]
    /// @param pieces       where they go
    PieceCutter(double longestEdge, std::vector<Piece>& pieces)
        : longestEdge2_(longestEdge * longestEdge), pieces_(pieces) {}

    /// Cuts a triangle by halving longest edges, and leaves out pieces whose box misses the limits. Pieces do not
    /// depend on the limits, and those of two triangles meet at the same points of a shared edge.
    void cut(const TriangleCorners& corners, std::uint32_t triangle, const TriangleLimits& limits) {
        const TriangleCorners& c = corners;
        const glm::dvec3 ab = c[1] - c[0], bc = c[2] - c[1], ca = c[0] - c[2];
        // most triangles of a fine mesh are short, and a call for each would take as long as the rest
        if (std::max({glm::dot(ab, ab), glm::dot(bc, bc), glm::dot(ca, ca)}) <= longestEdge2_)
            add(c[0], ab, -ca, triangle);
        else
            halve(c, triangle, limits);
    }

    /// Finishes the pieces that are still waiting: call it after the last triangle.
    void finish();

    /// Pieces are made by SIMD, this many at a time.
    static constexpr int batch = 16;

    /// Pieces to be made: a lattice point, a corner as seen from it, the ways from there to the next corners.
    struct Waiting {
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

    // Rounds to the nearest, halves always up, so that a shift by whole voxels shifts the result. For |value| < 2^31.
    static int roundToInt(double value) {
        constexpr double shift = 2147483648.0;
        return int(std::int64_t(value + 0.5 + shift) - std::int64_t(shift));
    }

    double longestEdge2_;
    std::vector<Piece>& pieces_;
    Waiting waiting_{};
    int count_ = 0;
};

}  // namespace bilayer::detail
