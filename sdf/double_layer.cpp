// The two layers of the paper's section 3.2 and Eq. 3, block by block. A block's squared distances stay in the
// first-level cache while all samples that reach it are applied, so there are no atomics and no order that threads
// could change.
//
// Highway compiles the part between HWY_BEFORE_NAMESPACE and HWY_AFTER_NAMESPACE once for each instruction set.
#include "sdf/double_layer.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "sdf/double_layer.cpp"
#include <hwy/cache_control.h>
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

HWY_BEFORE_NAMESPACE();
namespace bilayer::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Tag = hn::CappedTag<float, blockSide>;
using IntTag = hn::RebindToSigned<Tag>;
using Vec = hn::Vec<Tag>;

/// Tiles that are fetched before they are needed: about the latency of memory.
constexpr std::size_t tilesAhead = 6;

// Squared distances of one block to the samples of both layers, and whose they are.
struct Layers {
    HWY_ALIGN float inner2[blockVoxels];
    HWY_ALIGN float outer2[blockVoxels];
    HWY_ALIGN std::int32_t innerOwner[blockVoxels];
    HWY_ALIGN std::int32_t outerOwner[blockVoxels];
};

// A sample of the surface and its two layers, in the block's own voxels.
struct Sample {
    glm::vec3 centre, inner, outer;
};

inline float square(float value) {
    return value * value;
}

// The squared distance to the block along one axis.
inline float outside2(float coordinate) {
    constexpr float half = 0.5f * float(blockSide - 1);
    const float away = std::abs(coordinate - half) - half;
    return away > 0.f ? square(away) : 0.f;
}

/// Rows of eight voxels along z, a bit each: row (x, y) is bit 8 x + y.
using Rows = std::uint64_t;
constexpr int rowCount = blockSide * blockSide;

// Squared distances to a point along one axis of the block.
struct AxisDistances {
    explicit AxisDistances(float coordinate) {
        const Tag tag;
        for (std::size_t i = 0; i < std::size_t(blockSide); i += hn::Lanes(tag)) {
            const Vec away = hn::Sub(hn::Iota(tag, float(i)), hn::Set(tag, coordinate));
            hn::Store(hn::Mul(away, away), tag, squares + i);
        }
    }
    HWY_ALIGN float squares[blockSide];
};

// The rows that come nearer to the sample than `limit2` across z.
inline Rows rowsWithin(const Sample& s, float limit2) {
    const Tag tag;
    const AxisDistances alongX(s.centre.x), alongY(s.centre.y);
    const Vec limit = hn::Set(tag, limit2);
    Rows rows = 0;
    for (unsigned row = 0; row < unsigned(rowCount); row += unsigned(hn::Lanes(tag))) {
        const Vec x = hn::Set(tag, alongX.squares[row / blockSide]),
                  y = hn::Load(tag, alongY.squares + row % blockSide);
        std::uint8_t bits = 0;
        hn::StoreMaskBits(tag, hn::Lt(hn::Add(x, y), limit), &bits);
        rows |= Rows(bits) << row;
    }
    return rows;
}

// Squared distances from a layer's point to the rows, across z.
struct RowDistances {
    explicit RowDistances(const glm::vec3& point) {
        const Tag tag;
        const AxisDistances alongX(point.x), alongY(point.y);
        for (int row = 0; row < rowCount; row += int(hn::Lanes(tag)))
            hn::Store(
                hn::Add(hn::Set(tag, alongX.squares[row / blockSide]), hn::Load(tag, alongY.squares + row % blockSide)),
                tag, squares + row);
    }
    HWY_ALIGN float squares[rowCount];
};

// Applies samples to one layer's voxels.
template <bool withOwners>
inline void nearer(float across2, const float* along2, float* best, std::int32_t* owners, std::int32_t owner) {
    const Tag tag;
    const IntTag intTag;
    for (std::size_t z = 0; z < std::size_t(blockSide); z += hn::Lanes(tag)) {
        const Vec distance2 = hn::Add(hn::Set(tag, across2), hn::Load(tag, along2 + z));
        const Vec old = hn::Load(tag, best + z);
        if constexpr (withOwners) {
            // the first triangle of equally near ones stays
            const auto wins = hn::RebindMask(intTag, hn::Lt(distance2, old));
            hn::Store(hn::IfThenElse(wins, hn::Set(intTag, owner), hn::Load(intTag, owners + z)), intTag, owners + z);
        }
        hn::Store(hn::Min(distance2, old), tag, best + z);
    }
}

template <bool withOwners>
inline void update(const Sample& s, Rows rows, const AxisDistances& innerZ, const AxisDistances& outerZ, Layers& layers,
                   std::int32_t owner) {
    const RowDistances inner(s.inner), outer(s.outer);
    for (; rows != 0; rows &= rows - 1) {
        const int row = std::countr_zero(rows), voxel = row * blockSide;
        nearer<withOwners>(inner.squares[row], innerZ.squares, layers.inner2 + voxel, layers.innerOwner + voxel, owner);
        nearer<withOwners>(outer.squares[row], outerZ.squares, layers.outer2 + voxel, layers.outerOwner + voxel, owner);
    }
}

// Applies a sample to all rows that meet the ball of radius `reach` around it. Voxels of such a row that lie beyond the
// ball do no harm: a voxel counts only if it is certainly within the reach of its nearest sample.
template <bool withOwners>
inline void splatBall(const Sample& s, float reach, Layers& layers, std::int32_t owner) {
    const float limit2 = square(reach) - outside2(s.centre.z);
    if (outside2(s.centre.x) + outside2(s.centre.y) >= limit2) return;
    update<withOwners>(s, rowsWithin(s, limit2), AxisDistances(s.inner.z), AxisDistances(s.outer.z), layers, owner);
}

// Applies a sample to the paper's neighbourhood, the (2K + 1)^3 voxels around the voxel nearest to it.
template <bool withOwners>
inline void splatCube(const Sample& s, int k, Layers& layers, std::int32_t owner) {
    const auto spread = [&](float coordinate) {  // the neighbourhood along one axis, a bit each
        const int centre = int(std::floor(coordinate + 0.5f));
        unsigned bits = 0;
        for (int i = std::max(0, centre - k); i <= std::min(blockSide - 1, centre + k); ++i) bits |= 1u << i;
        return bits;
    };
    const unsigned x = spread(s.centre.x), y = spread(s.centre.y), z = spread(s.centre.z);
    Rows rows = 0;
    for (int i = 0; i < blockSide; ++i)
        if ((x >> i) & 1) rows |= Rows(y) << (i * blockSide);
    AxisDistances innerZ(s.inner.z), outerZ(s.outer.z);
    for (int i = 0; i < blockSide; ++i)
        if (!((z >> i) & 1)) innerZ.squares[i] = outerZ.squares[i] = std::numeric_limits<float>::infinity();
    update<withOwners>(s, rows, innerZ, outerZ, layers, owner);
}

// Whether a run of samples from a to b comes near the block at all.
inline bool runMisses(const glm::vec3& a, const glm::vec3& b, float reach) {
    constexpr float last = float(blockSide - 1);
    return std::max(a.x, b.x) < -reach || std::min(a.x, b.x) > last + reach || std::max(a.y, b.y) < -reach ||
           std::min(a.y, b.y) > last + reach || std::max(a.z, b.z) < -reach || std::min(a.z, b.z) > last + reach;
}

template <bool withOwners>
void applyTiles(const Tiles& tiles, std::span<const std::uint32_t> indices, const glm::ivec3& block,
                const FillParameters& parameters, Layers& layers) {
    for (std::size_t k = 0; k < indices.size(); ++k) {
        if (k + tilesAhead < indices.size()) hwy::Prefetch(&tiles.tiles[indices[k + tilesAhead]]);
        const std::uint32_t index = indices[k];
        const Tile& tile = tiles.tiles[index];
        const std::int32_t owner = withOwners ? tiles.triangles[index] : 0;
        const glm::vec3 shift(tile.base - block);
        for (int i = 0; i < tile.rows; ++i) {
            const glm::vec3 start = tile.first + float(i) * tile.down;
            if (i > 0 && runMisses(start + shift, start + float(i) * tile.across + shift, parameters.reach)) continue;
            for (int j = 0; j <= i; ++j) {
                const glm::vec3 p = start + float(j) * tile.across + shift;
                const Sample sample{p, p - tile.offset, p + tile.offset};
                if (parameters.cube > 0)
                    splatCube<withOwners>(sample, parameters.cube, layers, owner);
                else
                    splatBall<withOwners>(sample, parameters.reach, layers, owner);
            }
        }
    }
}

// Eq. 3: from both layers to signed distances. The inside keeps its sign bit where the distance is clamped to zero.
void combine(const Layers& layers, const FillParameters& parameters, float* distances) {
    const Tag tag;
    const Vec certain2 = hn::Set(tag, square(parameters.certain)), delta = hn::Set(tag, parameters.delta);
    const Vec unknown = hn::Set(tag, std::numeric_limits<float>::infinity());
    for (std::size_t i = 0; i < std::size_t(blockVoxels); i += hn::Lanes(tag)) {
        const Vec inner2 = hn::Load(tag, layers.inner2 + i), outer2 = hn::Load(tag, layers.outer2 + i);
        const auto inside = hn::Le(inner2, outer2);
        const Vec distance = hn::Sub(hn::Sqrt(hn::IfThenElse(inside, outer2, inner2)), delta);
        const Vec clamped = hn::Max(distance, hn::Zero(tag));
        const Vec phi = hn::IfThenElse(inside, hn::Neg(clamped), clamped);
        hn::StoreU(hn::IfThenElse(hn::Lt(hn::Min(inner2, outer2), certain2), phi, unknown), tag, distances + i);
    }
}

void fillBlock(const Tiles& tiles, std::span<const std::uint32_t> indices, const glm::ivec3& block,
               const FillParameters& parameters, float* distances, std::int32_t* triangles) {
    Layers layers;
    std::fill_n(layers.inner2, blockVoxels, std::numeric_limits<float>::infinity());
    std::fill_n(layers.outer2, blockVoxels, std::numeric_limits<float>::infinity());
    if (parameters.triangles) {
        std::fill_n(layers.innerOwner, blockVoxels, -1);
        std::fill_n(layers.outerOwner, blockVoxels, -1);
        applyTiles<true>(tiles, indices, block, parameters, layers);
        for (int i = 0; i < blockVoxels; ++i)
            triangles[i] = layers.inner2[i] <= layers.outer2[i] ? layers.outerOwner[i] : layers.innerOwner[i];
    } else {
        applyTiles<false>(tiles, indices, block, parameters, layers);
    }
    combine(layers, parameters, distances);
}

const char* targetName() {
    return hwy::TargetName(HWY_TARGET);
}

}  // namespace bilayer::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
#include <oneapi/tbb/enumerable_thread_specific.h>
#include <oneapi/tbb/parallel_for.h>

namespace bilayer {
namespace {

HWY_EXPORT(fillBlock);
HWY_EXPORT(targetName);

// What a thread works in; kept from brick to brick.
struct Scratch {
    BrickBlocks blocks;
    std::vector<float> distances;
    std::vector<std::int32_t> triangles;
};

void fillBrick(const FillJob& job, std::size_t brick, Scratch& scratch) {
    binBlocks(job.tiles, job.bricks, brick, job.parameters.reach, scratch.blocks);
    const std::size_t count = scratch.blocks.origins.size();
    scratch.distances.resize(count * blockVoxels);
    if (job.parameters.triangles) scratch.triangles.resize(count * blockVoxels);
    const auto fill = HWY_DYNAMIC_DISPATCH(fillBlock);
    for (std::size_t b = 0; b < count; ++b) {
        const std::uint32_t* tiles = scratch.blocks.tiles.data();
        fill(job.tiles, {tiles + scratch.blocks.offsets[b], tiles + scratch.blocks.offsets[b + 1]},
             scratch.blocks.origins[b], job.parameters, scratch.distances.data() + b * blockVoxels,
             job.parameters.triangles ? scratch.triangles.data() + b * blockVoxels : nullptr);
    }
    job.sink(brick, {scratch.blocks.origins, scratch.distances, scratch.triangles});
}

}  // namespace

BlockFiller tbbFiller() {
    return {"tbb", "", [](const FillJob& job) {
                tbb::enumerable_thread_specific<Scratch> scratch;
                tbb::parallel_for(std::size_t(0), job.bricks.count(),
                                  [&](std::size_t brick) { fillBrick(job, brick, scratch.local()); });
            }};
}

const char* simdName() {
    return HWY_DYNAMIC_DISPATCH(targetName)();
}

}  // namespace bilayer
#endif  // HWY_ONCE
