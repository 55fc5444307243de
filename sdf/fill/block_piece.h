// SPDX-License-Identifier: Apache-2.0
// Distances of the voxels of a block to one piece. Highway includes this file once for each instruction set:
// only between HWY_BEFORE_NAMESPACE's headers and its own, after hwy/highway.h.
// Tested by tests/sdf/exact.cpp through build().
#if defined(BILAYER_SDF_BLOCK_PIECE_H) == defined(HWY_TARGET_TOGGLE)
#ifdef BILAYER_SDF_BLOCK_PIECE_H
#undef BILAYER_SDF_BLOCK_PIECE_H
#else
#define BILAYER_SDF_BLOCK_PIECE_H
#endif

#include <hwy/highway.h>

#include <bit>
#include <cstdint>
#include <glm/vec3.hpp>

#include "sdf/fill/exact_block.h"
#include "sdf/fill/voxel_chunks.h"

HWY_BEFORE_NAMESPACE();
namespace bilayer::detail::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;
namespace {

// A piece relative to a block.
class BlockPiece {
  public:
    BlockPiece(const Piece& piece, std::uint32_t number, const glm::ivec3& block)
        : piece_(piece),
          code_(std::int32_t(number << sideBits)),
          shift_(block - piece.base),
          u_(along(piece.u.x)),
          w_(along(piece.w.x)),
          n_(along(piece.n.x)) {}

    // Lowers the distances in these slices of chunk c to those from the piece. Lattice coordinates are exact in floats,
    // so a voxel gets the same bytes in any block.
    inline void apply(int c, unsigned slices, BlockDistances& block) const {
        const ChunkTag tag;
        const auto place = [&](ChunkVec lattice, int shift, float origin) {
            return hn::Sub(hn::Add(lattice, hn::Set(tag, float(shift))), hn::Set(tag, origin));
        };
        const ChunkVec py = place(latticeY(c), shift_.y, piece_.origin.y),
                       pz = place(latticeZ(c), shift_.z, piece_.origin.z);
        const auto across = [&](const glm::vec3& axis) {
            return hn::Add(hn::Mul(py, hn::Set(tag, axis.y)), hn::Mul(pz, hn::Set(tag, axis.z)));
        };
        const ChunkVec u = across(piece_.u), w = across(piece_.w), n = across(piece_.n);
        for (; slices != 0; slices &= slices - 1) {
            const int x = std::countr_zero(slices);
            const auto at = [&](const Slices& along, ChunkVec across) {
                return hn::Add(hn::Set(tag, along.of[x]), across);
            };
            lower(at(u_, u), at(w_, w), at(n_, n), x * sliceVoxels + c * chunkVoxels, block);
        }
    }

  private:
    // The x-dependent part of a coordinate along an axis.
    Slices along(float axis) const {
        const Slices::Row row;
        // The shift is added first: it and x are integers, so their sum is exact.
        Slices part(-float(shift_.x),
                    [&](auto x) { return hn::Mul(hn::Sub(x, hn::Set(row, piece_.origin.x)), hn::Set(row, axis)); });
        return part;
    }

    // Returns how far a coordinate along an edge lies outside the edge.
    static ChunkVec beyond(ChunkVec along, float length) {
        const ChunkTag tag;
        return hn::Sub(along, hn::Min(hn::Max(along, hn::Zero(tag)), hn::Set(tag, length)));
    }

    inline void lower(ChunkVec u, ChunkVec w, ChunkVec n, int voxel, BlockDistances& block) const {
        const ChunkTag tag;
        const Piece& t = piece_;
        const ChunkVec base2 = hn::Add(squareOf(beyond(u, t.length)), squareOf(w));
        // The edges from both ends of the longest edge to the third corner.
        const ChunkVec ox = hn::Set(tag, t.ox), oy = hn::Set(tag, t.oy), ex = hn::Set(tag, t.ex),
                       ey = hn::Set(tag, t.ey);
        const ChunkVec v = hn::Sub(u, hn::Set(tag, t.length));
        const ChunkVec leftOf = hn::Sub(hn::Mul(w, ox), hn::Mul(u, oy)),
                       rightOf = hn::Sub(hn::Mul(w, ex), hn::Mul(v, ey));
        const ChunkVec left2 =
            hn::Add(squareOf(beyond(hn::Add(hn::Mul(u, ox), hn::Mul(w, oy)), t.olen)), squareOf(leftOf));
        const ChunkVec right2 =
            hn::Add(squareOf(beyond(hn::Add(hn::Mul(v, ex), hn::Mul(w, ey)), t.elen)), squareOf(rightOf));
        const ChunkVec zero = hn::Zero(tag), n2 = squareOf(n);
        const ChunkMask above = hn::And(hn::And(hn::Gt(w, zero), hn::Le(leftOf, zero)), hn::Ge(rightOf, zero));
        const ChunkVec distance2 = hn::Add(n2, hn::IfThenZeroElse(above, hn::Min(base2, hn::Min(left2, right2))));
        store(distance2, n, hn::And(above, hn::Gt(n2, hn::Set(tag, square(minFaceHeight)))), voxel, block);
    }

    // Keeps the smaller distance and its piece. Where the voxel projects onto a face, its normal gives the sign, unless
    // two pieces at equal distance (within float accuracy) disagree.
    inline void store(ChunkVec distance2, ChunkVec height, ChunkMask overFace, int voxel, BlockDistances& block) const {
        const ChunkTag tag;
        const ChunkIntTag intTag;
        const ChunkVec old2 = hn::Load(tag, block.nearest2 + voxel), nearest2 = hn::Min(distance2, old2);
        const auto old = hn::Load(intTag, block.nearest + voxel), sides = hn::Set(intTag, (1 << sideBits) - 1);
        const auto side = hn::IfThenElse(hn::RebindMask(intTag, hn::Gt(height, hn::Zero(tag))),
                                         hn::Set(intTag, code_ + sideOutside), hn::Set(intTag, code_ + sideInside));
        const auto code = hn::IfThenElse(hn::RebindMask(intTag, overFace), side, hn::Set(intTag, code_));
        const auto winner = hn::IfThenElse(hn::RebindMask(intTag, hn::Lt(distance2, old2)), code, old);
        const ChunkVec difference = hn::Sub(hn::Max(distance2, old2), nearest2);
        const ChunkMask tied =
            hn::Le(difference, hn::Add(hn::Mul(nearest2, hn::Set(tag, distanceTie)), hn::Set(tag, distanceTie)));
        const auto agreed = hn::Or(hn::AndNot(sides, winner), hn::And(hn::And(code, old), sides));
        hn::Store(nearest2, tag, block.nearest2 + voxel);
        hn::Store(hn::IfThenElse(hn::RebindMask(intTag, tied), agreed, winner), intTag, block.nearest + voxel);
    }

    const Piece& piece_;
    std::int32_t code_;
    glm::ivec3 shift_;
    Slices u_, w_, n_;
};

}  // namespace
}  // namespace bilayer::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
