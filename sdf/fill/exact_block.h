// The distances of one 8x8x8 block to the pieces that reach it, and what is known of the sides of its voxels.
//
// Certificate: every point of a piece lies within the piece's radius of its sample. A voxel whose distance is at most u
// therefore has its nearest piece's sample within u + radius; pieces beyond that are skipped, all others are asked. The
// first u is the distance to the nearest sample; it falls to the exact distance as pieces are asked. Small pieces are
// taken together in clusters with a sample and a radius of their own, so that most of them need not be looked at.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <span>

#include "sdf/fill/pieces.h"
#include "sdf/leaf/band.h"
#include "sdf/leaf/sign_propagation.h"

namespace bilayer::detail {

/// Pieces that lie together, in the voxels of their brick. All of them lie within `radius` of the sample and within
/// `thickness` of the plane through it.
struct Cluster {
    glm::vec3 sample;  ///< a point of one of the pieces
    float radius;
    glm::vec3 normal;
    float thickness;
    std::uint32_t begin, end;  ///< its members
};

/// A piece of a cluster, with what tells whether it must be asked.
struct Member {
    glm::vec3 sample;  ///< in the voxels of the brick
    float radius;
    glm::vec3 normal;
    std::uint32_t piece;
};

/// What reaches a block.
struct BlockInput {
    std::span<const std::uint32_t> reaching;  ///< indices into `clusters`
    const Cluster* clusters;
    const Member* members;
    const Piece* pieces;
    glm::ivec3 origin;  ///< index coordinates of the block's first voxel
    glm::vec3 inBrick;  ///< the same in the voxels of the brick
    float reach;        ///< [voxels]
};

/// What a voxel's code says besides the number of its nearest piece.
enum PieceSide : std::int32_t { sideUnknown = 0, sideOutside = 1, sideInside = 2, sideBits = 2 };

struct BlockDistances {
    alignas(64) float nearest2[blockVoxels];  ///< squared distance to the nearest piece [voxels^2]
    alignas(
        64) std::int32_t nearest[blockVoxels];  ///< (number of that piece << sideBits) + PieceSide; -1: beyond reach
    alignas(64) float distance[blockVoxels + blockSide];  ///< root of nearest2 [voxels]; a row more can be read
    BlockMask known;                                      ///< voxels within the reach
    BlockMask outside;   ///< voxels over the inside of a face, on its outer side, and well away from it
    BlockMask inside;    ///< the same on the inner side
    BlockMask far, mid;  ///< known voxels more than half a voxel, a tenth of a voxel away from the surface
};

/// Measures a block. False if no voxel is within the reach; `block` then holds nothing of use.
bool measureBlock(const BlockInput& input, BlockDistances& block);

/// Distances with their signs, farAway beyond the reach.
void signDistances(const BlockDistances& block, const BlockMask& inside, float* distances);

}  // namespace bilayer::detail
