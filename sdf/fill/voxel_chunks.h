// SPDX-License-Identifier: Apache-2.0
// The voxels of a block in SIMD chunks. Highway includes this file once for each instruction set: only between
// HWY_BEFORE_NAMESPACE's headers and its own, after hwy/highway.h.
// Tested by tests/sdf/exact.cpp.
#if defined(BILAYER_SDF_VOXEL_CHUNKS_H) == defined(HWY_TARGET_TOGGLE)
#ifdef BILAYER_SDF_VOXEL_CHUNKS_H
#undef BILAYER_SDF_VOXEL_CHUNKS_H
#else
#define BILAYER_SDF_VOXEL_CHUNKS_H
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <cstddef>
#include <glm/vec3.hpp>

#include "sdf/leaf/blocks.h"

HWY_BEFORE_NAMESPACE();
namespace bilayer::detail::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;
namespace {

/// As many voxels at once as there are lanes: half a row along z, a row, or two rows.
using ChunkTag = hn::CappedTag<float, 2 * blockSide>;
using ChunkIntTag = hn::RebindToSigned<ChunkTag>;
using ChunkVec = hn::Vec<ChunkTag>;
using ChunkMask = hn::Mask<ChunkTag>;

/// A slice is the 64 voxels with one x. A chunk is one SIMD vector of a slice.
constexpr int sliceVoxels = blockSide * blockSide;
constexpr int chunkVoxels = int(hn::MaxLanes(ChunkTag()));

// Lattice coordinates of the voxels in a slice.
struct BlockLattice {
    HWY_ALIGN float y[sliceVoxels], z[sliceVoxels];
};
constexpr BlockLattice blockLattice = [] {
    BlockLattice l{};
    for (int i = 0; i < sliceVoxels; ++i) {
        l.y[i] = float(i / blockSide);
        l.z[i] = float(i % blockSide);
    }
    return l;
}();

inline float square(float value) {
    return value * value;
}

inline ChunkVec squareOf(ChunkVec v) {
    return hn::Mul(v, v);
}

inline int firstFrom(float coordinate) {
    return coordinate > 0 ? int(coordinate) : 0;
}

inline int lastTo(float coordinate) {
    return coordinate < 0 ? -1 : std::min(blockSide - 1, int(coordinate));
}

// Calls visit(c, first slice, last slice) for the chunks that a ball may reach. Tests only the ball's box: a cheap test
// saves more than excluding the corners.
template <class Visit>
inline void forEachChunk(const glm::vec3& centre, float radius, Visit visit) {
    const int x0 = firstFrom(centre.x - radius), x1 = lastTo(centre.x + radius);
    if (x0 > x1) return;
    const int end = (lastTo(centre.y + radius) + 1) * blockSide;
    for (int c = firstFrom(centre.y - radius) * blockSide / chunkVoxels; c * chunkVoxels < end; ++c) visit(c, x0, x1);
}

// One value per slice.
struct Slices {
    using Row = hn::CappedTag<float, blockSide>;
    using RowVec = hn::Vec<Row>;

    // Evaluates make(x) for all slices at once, with x relative to `centre`.
    template <class Make>
    Slices(float centre, Make make) {
        const Row row;
        for (std::size_t x = 0; x < std::size_t(blockSide); x += hn::Lanes(row))
            hn::Store(make(hn::Sub(hn::Iota(row, float(x)), hn::Set(row, centre))), row, of + x);
    }
    static RowVec square(RowVec v) { return hn::Mul(v, v); }

    HWY_ALIGN float of[blockSide];
};

inline ChunkVec latticeY(int c) {
    return hn::Load(ChunkTag(), blockLattice.y + c * chunkVoxels);
}

inline ChunkVec latticeZ(int c) {
    return hn::Load(ChunkTag(), blockLattice.z + c * chunkVoxels);
}

}  // namespace
}  // namespace bilayer::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
