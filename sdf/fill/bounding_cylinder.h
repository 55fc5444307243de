// SPDX-License-Identifier: Apache-2.0
// Bounding cylinders of pieces: which voxels the pieces may be nearest to. Highway includes this file once for each
// instruction set: only between HWY_BEFORE_NAMESPACE's headers and its own, after hwy/highway.h.
// Tested by tests/sdf/exact.cpp.
#if defined(BILAYER_SDF_BOUNDING_CYLINDER_H) == defined(HWY_TARGET_TOGGLE)
#ifdef BILAYER_SDF_BOUNDING_CYLINDER_H
#undef BILAYER_SDF_BOUNDING_CYLINDER_H
#else
#define BILAYER_SDF_BOUNDING_CYLINDER_H
#endif

#include <hwy/highway.h>

#include <bit>
#include <cmath>
#include <glm/vec3.hpp>

#include "sdf/fill/exact_block.h"
#include "sdf/fill/voxel_chunks.h"

HWY_BEFORE_NAMESPACE();
namespace bilayer::detail::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;
namespace {

/// Upper bound of the float error of a distance, with a margin [voxels]. Pieces that are too far by this much are still
/// evaluated, so that the nearest piece never depends on the order.
constexpr float boundSlack = 1e-4f;
/// Rounding of squared heights, with a margin [voxels^2].
constexpr float heightSlack = 1e-3f;

// A bounding disc, or a bounding cylinder with some thickness, around pieces, relative to a block. Consider a
// voxel at height h over the cylinder's plane and at distance r from its axis, with an upper bound b of its distance.
// It is farther than b from the cylinder if r > radius + sqrt(b^2 - g^2), where g = max(0, |h| - thickness). Squaring
// this twice removes the roots. r^2 = d^2 - h^2 follows from the distance d to the centre.
class BoundingCylinder {
  public:
    BoundingCylinder(const glm::vec3& centre, float radius, const glm::vec3& normal, float thickness)
        : centre_(centre),
          normal_(normal),
          thickness_(thickness + boundSlack),
          radius2_(square(radius + boundSlack)),
          px2_(centre.x, Slices::square),
          height_(centre.x, [&](auto px) { return hn::Mul(px, hn::Set(Slices::Row(), normal.x)); }) {}

    // Returns the slices out of x0 .. x1, one bit each, in which chunk c has a voxel that the cylinder may be nearest
    // to.
    template <bool thick>
    inline unsigned near(int c, int x0, int x1, const BlockDistances& block) const {
        const Column column(*this, c);
        const float* bound2 = block.nearest2 + x0 * sliceVoxels + c * chunkVoxels;
        unsigned near = 0;
        for (int x = x0; x <= x1; ++x, bound2 += sliceVoxels)
            near |= unsigned(mayBeNearest<thick>(column, x, bound2)) << x;
        return near;
    }

    // The same for the slices `among`.
    inline unsigned near(int c, unsigned among, const BlockDistances& block) const {
        const Column column(*this, c);
        unsigned near = 0;
        for (; among != 0; among &= among - 1) {
            const int x = std::countr_zero(among);
            const bool may = mayBeNearest<false>(column, x, block.nearest2 + x * sliceVoxels + c * chunkVoxels);
            near |= unsigned(may) << x;
        }
        return near;
    }

  private:
    // Values shared by all slices of a chunk.
    struct Column {
        Column(const BoundingCylinder& cylinder, int c) {
            const ChunkTag tag;
            const ChunkVec py = hn::Sub(latticeY(c), hn::Set(tag, cylinder.centre_.y)),
                           pz = hn::Sub(latticeZ(c), hn::Set(tag, cylinder.centre_.z));
            excess = hn::Sub(hn::Add(squareOf(py), squareOf(pz)), hn::Set(tag, cylinder.radius2_));
            height =
                hn::Add(hn::Mul(py, hn::Set(tag, cylinder.normal_.y)), hn::Mul(pz, hn::Set(tag, cylinder.normal_.z)));
            fourRadius2 = hn::Set(tag, 4 * cylinder.radius2_);
        }
        ChunkVec excess, height, fourRadius2;
    };

    template <bool thick>
    inline bool mayBeNearest(const Column& column, int x, const float* bounds2) const {
        const ChunkTag tag;
        const ChunkVec bound2 = hn::Load(tag, bounds2);
        const ChunkVec h = hn::Add(hn::Set(tag, height_.of[x]), column.height);
        ChunkVec excess = hn::Sub(hn::Add(hn::Set(tag, px2_.of[x]), column.excess), bound2), g2 = squareOf(h);
        if constexpr (thick) {
            const ChunkVec h2 = g2;
            g2 = squareOf(hn::Max(hn::Sub(hn::Abs(h), hn::Set(tag, thickness_)), hn::Zero(tag)));
            excess = hn::Add(excess, hn::Sub(g2, h2));
        }
        const ChunkVec limit = hn::Mul(column.fourRadius2, hn::Add(hn::Sub(bound2, g2), hn::Set(tag, heightSlack)));
        return !hn::AllFalse(tag, hn::Le(hn::Mul(excess, hn::Abs(excess)), limit));
    }

    glm::vec3 centre_, normal_;
    float thickness_, radius2_;
    Slices px2_, height_;
};

}  // namespace
}  // namespace bilayer::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
