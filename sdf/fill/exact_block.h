// SPDX-License-Identifier: Apache-2.0
// The distances of one 8x8x8 block to the pieces that reach it, and the signs that they determine.
//
// Certificate: every point of a piece lies within the piece's radius of its sample. If a voxel's distance is at most u,
// the sample of its nearest piece is within u + radius. Pieces beyond that are skipped, all others are evaluated. The
// first bound u is the distance to the nearest sample; it decreases to the exact distance as pieces are evaluated.
// Small pieces form clusters with their own sample and radius, so that most pieces are skipped together.
// Tested by tests/sdf/exact.cpp through build().
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <span>

#include "sdf/fill/pieces.h"
#include "sdf/leaf/band.h"
#include "sdf/leaf/sign_propagation.h"

namespace bilayer::detail {

/// A group of neighbouring pieces, in the voxels of their brick. All of them lie within `radius` of the sample and
/// within `thickness` of the plane through the sample.
struct Cluster {
    glm::vec3 sample;  ///< a point of one of the pieces
    float radius;
    glm::vec3 normal;
    float thickness;
    std::uint32_t begin, end;  ///< range of members
};

/// A piece of a cluster, with the bounds that decide whether it must be evaluated.
struct ClusterMember {
    glm::vec3 sample;  ///< [brick voxels]
    float radius;
    glm::vec3 normal;
    std::uint32_t piece;
};

/// The clusters and pieces that reach a block.
struct BlockInput {
    std::span<const std::uint32_t> reachingClusters;  ///< indices into `clusters`
    const Cluster* clusters;
    const ClusterMember* members;
    const Piece* pieces;
    glm::ivec3 origin;  ///< index coordinates of the block's first voxel
    glm::vec3 inBrick;  ///< the same in brick voxels
    float reach;        ///< [voxels]
};

/// The side of a voxel, encoded together with the index of its nearest piece.
enum PieceSide : std::int32_t { sideUnknown = 0, sideOutside = 1, sideInside = 2 };
inline constexpr int sideBits = 2;  ///< of a PieceSide

struct BlockDistances {
    alignas(64) float nearest2[blockVoxels];        ///< squared distance to the nearest piece [voxels^2]
    alignas(64) std::int32_t nearest[blockVoxels];  ///< (index of that piece << sideBits) + PieceSide; -1: beyond reach
    alignas(
        64) float distance[blockVoxels + blockSide];  ///< square root of nearest2 [voxels]; one more row may be read
    BlockMask known;                                  ///< voxels within the reach
    BlockMask outside;   ///< voxels that project onto the interior of a face, on its outer side, not too close to it
    BlockMask inside;    ///< the same on the inner side
    BlockMask far, mid;  ///< known voxels farther than 0.5 and 0.1 voxels from the surface
};

/// Computes the distances of a block. Returns false if no voxel is within reach; the contents of `block` are then
/// undefined.
bool measureBlock(const BlockInput& input, BlockDistances& block);

/// Writes the signed distances; farAway beyond the reach.
void signDistances(const BlockDistances& block, const BlockMask& inside, float* distances);

}  // namespace bilayer::detail
