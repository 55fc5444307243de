// The two layers of the paper's section 3.2 and Eq. 3, block by block. A block's squared distances stay in the first-level
// cache while all samples that reach it are applied, so there are no atomics and no order that threads could change.
//
// Highway compiles the part between HWY_BEFORE_NAMESPACE and HWY_AFTER_NAMESPACE once for each instruction set.
#include "sdf/double_layer.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "sdf/double_layer.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>
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

// Squared distances of one block to the samples of both layers, and whose they are.
struct Layers {
    HWY_ALIGN float inner2[blockVoxels];
    HWY_ALIGN float outer2[blockVoxels];
    HWY_ALIGN std::int32_t innerOwner[blockVoxels];
    HWY_ALIGN std::int32_t outerOwner[blockVoxels];
};

struct Sample {
    float x, y, z;              // in the block's own voxels
    float innerX, innerY, innerZ;
    float outerX, outerY, outerZ;
};

inline float square(float value) { return value * value; }
inline float outside(float coordinate) { return coordinate - std::clamp(coordinate, 0.f, float(blockSide - 1)); }

// Applies a sample to the rows of voxels that a ball or a cube around it touches.
template <bool withOwners>
class Splat {
  public:
    Splat(const FillParameters& parameters, Layers& layers) : parameters_(parameters), layers_(layers) {}

    void operator()(const Sample& s, std::int32_t owner) const {
        if (parameters_.cube > 0)
            cube(s, owner);
        else
            ball(s, owner);
    }

  private:
    // Whole rows are updated: voxels of a row beyond the ball do no harm, since a voxel counts only if it lies certainly
    // within the reach of its nearest sample.
    void ball(const Sample& s, std::int32_t owner) const {
        const float reach2 = square(parameters_.reach);
        const float left = reach2 - square(outside(s.z));
        if (left <= square(outside(s.x)) + square(outside(s.y))) return;
        const RowDistances rows(s);
        const float halfX = std::sqrt(left);
        const int firstX = std::max(0, int(s.x - halfX + 1)), lastX = std::min(blockSide - 1, int(s.x + halfX));
        for (int x = firstX; x <= lastX; ++x) {
            const float leftY = left - square(float(x) - s.x);
            if (leftY <= square(outside(s.y))) continue;
            const float halfY = std::sqrt(leftY);
            const int firstY = std::max(0, int(s.y - halfY + 1)), lastY = std::min(blockSide - 1, int(s.y + halfY));
            update(s, rows, x, firstY, lastY, owner);
        }
    }

    // The paper's neighbourhood: (2K + 1)^3 voxels around the voxel nearest to the sample.
    void cube(const Sample& s, std::int32_t owner) const {
        const int k = parameters_.cube;
        const int cx = int(std::floor(s.x + 0.5f)), cy = int(std::floor(s.y + 0.5f)), cz = int(std::floor(s.z + 0.5f));
        RowDistances rows(s);
        rows.keep(cz - k, cz + k);
        for (int x = std::max(0, cx - k); x <= std::min(blockSide - 1, cx + k); ++x)
            update(s, rows, x, std::max(0, cy - k), std::min(blockSide - 1, cy + k), owner);
    }

    // The squared distances along z to both layers' samples, the same for every row.
    struct RowDistances {
        explicit RowDistances(const Sample& s) {
            const Tag tag;
            for (std::size_t z = 0; z < std::size_t(blockSide); z += hn::Lanes(tag)) {
                const Vec at = hn::Iota(tag, float(z));
                const Vec inner = hn::Sub(at, hn::Set(tag, s.innerZ)), outer = hn::Sub(at, hn::Set(tag, s.outerZ));
                hn::Store(hn::Mul(inner, inner), tag, inner2 + z);
                hn::Store(hn::Mul(outer, outer), tag, outer2 + z);
            }
        }
        void keep(int first, int last) {
            for (int z = 0; z < blockSide; ++z)
                if (z < first || z > last) inner2[z] = outer2[z] = std::numeric_limits<float>::infinity();
        }
        HWY_ALIGN float inner2[blockSide];
        HWY_ALIGN float outer2[blockSide];
    };

    void update(const Sample& s, const RowDistances& rows, int x, int firstY, int lastY, std::int32_t owner) const {
        const float inner2 = square(float(x) - s.innerX), outer2 = square(float(x) - s.outerX);
        for (int y = firstY; y <= lastY; ++y) {
            const int row = (x * blockSide + y) * blockSide;
            nearer(rows.inner2, inner2 + square(float(y) - s.innerY), layers_.inner2 + row, layers_.innerOwner + row, owner);
            nearer(rows.outer2, outer2 + square(float(y) - s.outerY), layers_.outer2 + row, layers_.outerOwner + row, owner);
        }
    }

    // A row of eight voxels keeps the smaller distance; the first triangle of equal ones stays.
    static void nearer(const float* alongZ, float across2, float* best, std::int32_t* owners, std::int32_t owner) {
        const Tag tag;
        const IntTag intTag;
        for (std::size_t z = 0; z < std::size_t(blockSide); z += hn::Lanes(tag)) {
            const Vec distance2 = hn::Add(hn::Set(tag, across2), hn::Load(tag, alongZ + z));
            const Vec old = hn::Load(tag, best + z);
            if constexpr (withOwners) {
                const auto wins = hn::RebindMask(intTag, hn::Lt(distance2, old));
                hn::Store(hn::IfThenElse(wins, hn::Set(intTag, owner), hn::Load(intTag, owners + z)), intTag, owners + z);
            }
            hn::Store(hn::Min(distance2, old), tag, best + z);
        }
    }

    const FillParameters& parameters_;
    Layers& layers_;
};

// Whether a run of samples from a to b comes near the block at all.
inline bool runMisses(const glm::vec3& a, const glm::vec3& b, float reach) {
    constexpr float last = float(blockSide - 1);
    return std::max(a.x, b.x) < -reach || std::min(a.x, b.x) > last + reach || std::max(a.y, b.y) < -reach ||
           std::min(a.y, b.y) > last + reach || std::max(a.z, b.z) < -reach || std::min(a.z, b.z) > last + reach;
}

template <bool withOwners>
void applyTiles(const Tiles& tiles, std::span<const std::uint32_t> indices, const glm::ivec3& block,
                const FillParameters& parameters, Layers& layers) {
    const Splat<withOwners> splat(parameters, layers);
    for (const std::uint32_t index : indices) {
        const Tile& tile = tiles.tiles[index];
        const std::int32_t owner = withOwners ? tiles.triangles[index] : 0;
        const glm::vec3 shift(tile.base - block);
        for (int i = 0; i < tile.rows; ++i) {
            const glm::vec3 start = tile.first + float(i) * tile.down;
            if (i > 0 && runMisses(start + shift, start + float(i) * tile.across + shift, parameters.reach)) continue;
            for (int j = 0; j <= i; ++j) {
                const glm::vec3 p = start + float(j) * tile.across + shift;
                const glm::vec3 inner = p - tile.offset, outer = p + tile.offset;
                splat({p.x, p.y, p.z, inner.x, inner.y, inner.z, outer.x, outer.y, outer.z}, owner);
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
        hn::Store(hn::IfThenElse(hn::Lt(hn::Min(inner2, outer2), certain2), phi, unknown), tag, distances + i);
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

const char* targetName() { return hwy::TargetName(HWY_TARGET); }

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

const char* simdName() { return HWY_DYNAMIC_DISPATCH(targetName)(); }

}  // namespace bilayer
#endif  // HWY_ONCE
