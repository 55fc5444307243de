// SPDX-License-Identifier: Apache-2.0
// Checks the proof obligations of the exact method in double precision (docs/exactness.md, "Certificate"). They are
// asserted for every voxel of a build where the library is compiled with BILAYER_VERIFY; builds then take some ten
// times as long.
//
// Tested by tests/sdf/certificate.cpp.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "sdf/base/triangle_corners.h"
#include "sdf/fill/exact_block.h"
#include "sdf/fill/triangle_bins.h"

namespace bilayer::detail {

/// Obligation 1: a brick has all triangles that come within reach of one of its voxels.
/// Throws std::logic_error that names a triangle and a brick.
void requireCompleteBins(const Mesh& mesh, const TriangleBins& bins, double voxelsPerUnit, float reach);

/// Obligation 2: all points of a piece lie within its radius of its sample, and all points of the members of a cluster
/// lie in its cylinder. Throws std::logic_error that names a triangle.
/// @param brick  index coordinates of the brick's first voxel
void requireCovered(std::span<const Piece> pieces, std::span<const Cluster> clusters,
                    std::span<const ClusterMember> members, const glm::ivec3& brick);

/// The triangles of a brick, which its distances are checked against.
class BlockCheck {
  public:
    BlockCheck(const Mesh& mesh, std::span<const std::uint32_t> triangles, double voxelsPerUnit);

    /// Obligations 3 and 4: the distance of a voxel is that of its nearest piece, and no triangle is nearer, or within
    /// reach of a voxel without one; up to exactError. Throws std::logic_error that names a voxel and a triangle.
    /// @param origin  index coordinates of the block's first voxel
    /// @param pieces  of the brick, which BlockDistances::nearest counts
    void require(const glm::ivec3& origin, std::span<const Piece> pieces, const BlockDistances& block, float reach);

  private:
    /// A triangle and the smallest ball about its centroid [voxels].
    struct Ball {
        TriangleCorners corners;
        glm::dvec3 centre;
        double radius;
        std::uint32_t triangle;
    };

    struct Voxel {
        glm::ivec3 at;
        double distance;         ///< or the reach, if it has no distance [voxels]
        std::uint32_t triangle;  ///< the nearest one, or the largest number
    };
    void requirePart(const glm::ivec3& origin, const glm::ivec3& first, std::span<const Piece> pieces,
                     const BlockDistances& block, float reach);
    void requireVoxel(const Voxel& voxel) const;

    std::vector<Ball> balls_;
    std::vector<const Ball*> near_;  ///< the current part of a block
};

}  // namespace bilayer::detail
