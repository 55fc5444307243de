// SPDX-License-Identifier: Apache-2.0
// Inside/outside classification of a point by the angle-weighted pseudonormal of its closest feature: J. A. Baerentzen,
// H. Aanaes, "Signed distance computation using the angle weighted pseudonormal", IEEE TVCG 11 (2005) 243-253.
//
// The normals of all triangles that meet at the closest point are summed. These triangles are found by geometry, not by
// indices. Vertices need not be welded, edges need no adjacency, duplicate faces count once, and faces without area do
// not count.
// Tested by tests/sdf/closest_side.cpp through build().
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <optional>
#include <vector>

#include <bilayer/sdf/mesh.h>
#include "sdf/base/triangle_corners.h"

namespace bilayer::detail {

/// Tolerance of a search for all triangles that can be nearest to a point [voxels].
inline constexpr float sideSlack = 1e-3f;

/// The side of a point. `undecided` where the normals nearly cancel out. They have no meaning at a vertex where two
/// parts of the surface touch, and little meaning at the sharp end of a needle triangle.
enum class Side { outside, inside, undecided };

/// Classifies one point. Offer every triangle that may be nearest, in any order and with repetitions if needed.
class ClosestSide {
  public:
    ClosestSide(const Mesh& mesh, double voxelsPerUnit) : mesh_(mesh), voxelsPerUnit_(voxelsPerUnit) {}

    /// Starts a point [voxels].
    void begin(const glm::dvec3& point);

    /// Adds a triangle.
    void offer(std::uint32_t triangle);

    /// Returns the side by all offered triangles; `undecided` if the normals at the closest point cancel out.
    Side side() const;

    /// Returns the corners of a triangle relative to the point [voxels].
    TriangleCorners cornersOf(std::uint32_t triangle) const;

    /// Returns the distance to the nearest offered triangle [voxels].
    double distance() const { return distance_; }

  private:
    struct CandidateFace {
        std::uint32_t triangle;
        TriangleCorners corners;  // relative to the point [voxels]
        glm::dvec3 closest;       // likewise
        double distance;
    };

    const Mesh& mesh_;
    double voxelsPerUnit_;
    glm::dvec3 point_{0};
    double distance_ = 0;
    std::vector<CandidateFace> faces_;
};

/// Returns how the segment from the origin to `end` crosses a triangle: +1 along its normal, -1 against it, 0 not at
/// all. Empty if the crossing is too close to an edge, a corner or the ends of the segment.
std::optional<int> segmentCrossing(const TriangleCorners& corners, const glm::dvec3& end);

/// Returns the point of a triangle that is closest to the origin. Also valid for triangles without area.
glm::dvec3 closestToOrigin(const TriangleCorners& corners);

/// Returns the distance of a point to a triangle. Also valid for triangles without area.
inline double distanceTo(const TriangleCorners& corners, const glm::dvec3& point) {
    return glm::length(closestToOrigin({corners[0] - point, corners[1] - point, corners[2] - point}));
}

}  // namespace bilayer::detail
