// SPDX-License-Identifier: Apache-2.0
// Highway compiles the code between HWY_BEFORE_NAMESPACE and HWY_AFTER_NAMESPACE once per instruction set.
#include "sdf/fill/exact_block.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "sdf/fill/exact_block.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>
#include <cstring>

#include "sdf/fill/block_piece.h"
#include "sdf/fill/bounding_cylinder.h"
#include "sdf/fill/voxel_chunks.h"

HWY_BEFORE_NAMESPACE();
namespace bilayer::detail::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;
namespace {

/// Sample bounds are increased by this fraction and this amount, together at least 2e-5 voxels. A piece's own distance
/// then replaces its sample's, although the two are rounded differently.
constexpr float raisedPart = 1e-3f, raisedBy = 5e-7f;  // [voxels^2]

// Reduces squared distances to those to a sample.
inline void applySample(const glm::vec3& sample, float reach, BlockDistances& block) {
    const ChunkTag tag;
    const Slices px2(sample.x, Slices::square);
    forEachChunk(sample, reach, [&](int c, int x0, int x1) {
        const ChunkVec across2 = hn::Add(squareOf(hn::Sub(latticeY(c), hn::Set(tag, sample.y))),
                                         squareOf(hn::Sub(latticeZ(c), hn::Set(tag, sample.z))));
        float* nearest2 = block.nearest2 + x0 * sliceVoxels + c * chunkVoxels;
        for (int x = x0; x <= x1; ++x, nearest2 += sliceVoxels)
            hn::Store(hn::Min(hn::Load(tag, nearest2), hn::Add(hn::Set(tag, px2.of[x]), across2)), tag, nearest2);
    });
}

// Initial bounds: the distances to the samples. They are slightly increased, so that a piece's own distance replaces
// its sample's.
void applySamples(const BlockInput& input, BlockDistances& block) {
    const ChunkTag tag;
    const ChunkIntTag intTag;
    const ChunkVec reach2 = hn::Set(tag, square(input.reach));
    for (int i = 0; i < blockVoxels; i += chunkVoxels) hn::Store(reach2, tag, block.nearest2 + i);
    for (const std::uint32_t index : input.reachingClusters)
        applySample(input.clusters[index].sample - input.inBrick, input.reach, block);
    for (int i = 0; i < blockVoxels; i += chunkVoxels) {
        const ChunkVec raised =
            hn::Add(hn::Mul(hn::Load(tag, block.nearest2 + i), hn::Set(tag, 1 + raisedPart)), hn::Set(tag, raisedBy));
        hn::Store(hn::Min(raised, reach2), tag, block.nearest2 + i);
        hn::Store(hn::Set(intTag, -1), intTag, block.nearest + i);
    }
}

// The slices near a cluster for each chunk, one bit each.
struct NearChunks {
    int first, last;
    unsigned slices[sliceVoxels / chunkVoxels];
};

// Evaluates the members of a cluster that come near its chunks.
inline void applyMembers(const BlockInput& input, const Cluster& cluster, const NearChunks& near,
                         BlockDistances& block) {
    if (cluster.end - cluster.begin == 1) {
        const std::uint32_t number = input.members[cluster.begin].piece;
        const BlockPiece piece(input.pieces[number], number, input.origin);
        for (int c = near.first; c <= near.last; ++c) piece.apply(c, near.slices[c], block);
        return;
    }
    for (std::uint32_t m = cluster.begin; m < cluster.end; ++m) {
        const ClusterMember& member = input.members[m];
        const BoundingCylinder cylinder(member.sample - input.inBrick, member.radius, member.normal, 0);
        NearChunks nearMember{near.first, near.last, {}};
        unsigned any = 0;
        for (int c = near.first; c <= near.last; ++c)
            any |= nearMember.slices[c] = cylinder.near(c, near.slices[c], block);
        if (any == 0) continue;
        const BlockPiece piece(input.pieces[member.piece], member.piece, input.origin);
        for (int c = near.first; c <= near.last; ++c)
            if (nearMember.slices[c] != 0) piece.apply(c, nearMember.slices[c], block);
    }
}

void applyPieces(const BlockInput& input, BlockDistances& block) {
    for (const std::uint32_t index : input.reachingClusters) {
        const Cluster& cluster = input.clusters[index];
        const glm::vec3 sample = cluster.sample - input.inBrick;
        const BoundingCylinder cylinder(sample, cluster.radius, cluster.normal, cluster.thickness);
        NearChunks near{sliceVoxels, -1, {}};
        forEachChunk(sample, input.reach + cluster.radius, [&](int c, int x0, int x1) {
            near.slices[c] =
                cluster.thickness > 0 ? cylinder.near<true>(c, x0, x1, block) : cylinder.near<false>(c, x0, x1, block);
            if (near.slices[c] == 0) return;
            near.first = std::min(near.first, c);
            near.last = c;
        });
        if (near.first <= near.last) applyMembers(input, cluster, near, block);
    }
}

inline void setBits(ChunkMask mask, int voxel, BlockMask& bits) {
    std::uint8_t some[8] = {};
    hn::StoreMaskBits(ChunkTag(), mask, some);
    std::uint64_t word;
    std::memcpy(&word, some, sizeof word);
    bits[std::size_t(voxel / sliceVoxels)] |= word << (voxel % sliceVoxels);
}

void summarize(BlockDistances& block) {
    const ChunkTag tag;
    const ChunkIntTag intTag;
    block.known = block.outside = block.inside = block.far = block.mid = {};
    for (int i = 0; i < blockVoxels; i += chunkVoxels) {
        const ChunkVec distance = hn::Sqrt(hn::Load(tag, block.nearest2 + i));
        hn::Store(distance, tag, block.distance + i);
        const auto nearest = hn::Load(intTag, block.nearest + i);
        const ChunkMask known = hn::RebindMask(tag, hn::Gt(nearest, hn::Set(intTag, -1)));
        // A piece at exactly the reach sets its sign bits, but is not stored as nearest.
        const auto has = [&](std::int32_t side) {
            const auto sides = hn::And(nearest, hn::Set(intTag, (1 << sideBits) - 1));
            return hn::And(known, hn::RebindMask(tag, hn::Eq(sides, hn::Set(intTag, side))));
        };
        setBits(known, i, block.known);
        // On the surface either sign is right, and no link can propagate it.
        setBits(hn::Or(has(sideOutside), hn::Lt(distance, hn::Set(tag, 0.5f * linkSlack))), i, block.outside);
        setBits(has(sideInside), i, block.inside);
        setBits(hn::And(known, hn::Gt(distance, hn::Set(tag, farFrom))), i, block.far);
        setBits(hn::And(known, hn::Gt(distance, hn::Set(tag, midFrom))), i, block.mid);
    }
}

bool measureBlock(const BlockInput& input, BlockDistances& block) {
    applySamples(input, block);
    applyPieces(input, block);
    summarize(block);
    return any(block.known);
}

void signDistances(const BlockDistances& block, const BlockMask& inside, float* distances) {
    const ChunkTag tag;
    const ChunkIntTag intTag;
    for (int i = 0; i < blockVoxels; i += chunkVoxels) {
        const std::uint64_t word = inside[std::size_t(i / sliceVoxels)] >> (i % sliceVoxels);
        std::uint8_t bits[8];
        std::memcpy(bits, &word, sizeof bits);
        const ChunkMask known = hn::RebindMask(tag, hn::Gt(hn::Load(intTag, block.nearest + i), hn::Set(intTag, -1)));
        const ChunkVec distance = hn::IfThenElse(known, hn::Load(tag, block.distance + i), hn::Set(tag, farAway));
        hn::StoreU(hn::IfThenElse(hn::LoadMaskBits(tag, bits), hn::Neg(distance), distance), tag, distances + i);
    }
}

}  // namespace
}  // namespace bilayer::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bilayer::detail {

HWY_EXPORT(measureBlock);
HWY_EXPORT(signDistances);

bool measureBlock(const BlockInput& input, BlockDistances& block) {
    return HWY_DYNAMIC_DISPATCH(measureBlock)(input, block);
}

void signDistances(const BlockDistances& block, const BlockMask& inside, float* distances) {
    HWY_DYNAMIC_DISPATCH(signDistances)(block, inside, distances);
}

}  // namespace bilayer::detail
#endif  // HWY_ONCE
