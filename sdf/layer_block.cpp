// Highway compiles the part between HWY_BEFORE_NAMESPACE and HWY_AFTER_NAMESPACE once for each instruction set.
#include "sdf/layer_block.h"

#include "sdf/double_layer.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "sdf/layer_block.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

HWY_BEFORE_NAMESPACE();
namespace bilayer::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

constexpr int cubeSide = LayerSamples::cellSide;  // voxels
constexpr int sliceVoxels = cubeSide * cubeSide;  // of one x
constexpr int cubesPerSide = blockSide / cubeSide;
constexpr int cubesPerBlock = cubesPerSide * cubesPerSide * cubesPerSide;

/// As many voxels of a slice at once as there are lanes: rows along z.
using Tag = hn::CappedTag<float, sliceVoxels>;
using IntTag = hn::RebindToSigned<Tag>;
using Vec = hn::Vec<Tag>;
using Mask = hn::Mask<Tag>;
using IntVec = hn::Vec<IntTag>;

constexpr float infinite = std::numeric_limits<float>::infinity();
constexpr float halfCube = 0.5f * float(cubeSide - 1);  // from the middle of a cube to its last voxels

// Places of a slice's voxels, from the middle of their cube.
struct Lattice {
    alignas(64) float y[sliceVoxels], z[sliceVoxels];
};
constexpr Lattice lattice = [] {
    Lattice l{};
    for (int i = 0; i < sliceVoxels; ++i) {
        l.y[i] = float(i / cubeSide) - halfCube;
        l.z[i] = float(i % cubeSide) - halfCube;
    }
    return l;
}();

inline float sliceAt(int x) {
    return float(x) - halfCube;
}

inline Vec squareOf(Vec v) {
    return hn::Mul(v, v);
}

// a x + b y + c z + d for one vector's part of all slices of a cube.
struct Linear {
    HWY_INLINE Linear(float a, float b, float c, float d, Vec y, Vec z) {
        const Tag tag;
        along = hn::Set(tag, a);
        across = hn::MulAdd(z, hn::Set(tag, c), hn::MulAdd(y, hn::Set(tag, b), hn::Set(tag, d)));
    }
    HWY_INLINE Vec at(int x) const { return hn::MulAdd(along, hn::Set(Tag(), sliceAt(x)), across); }
    Vec along, across;
};

// One vector's part of each slice of a cube: where its voxels are, from the middle of the cube, and what was found for
// them. Distances are squared and less delta^2 and the voxel's own squared distance from the middle: what remains of
// |v - s|^2 is linear in v.
template <bool withOwners>
struct Voxels {
    explicit Voxels(int part) {
        const Tag tag;
        const auto at = std::size_t(part) * hn::Lanes(tag);
        y = hn::Load(tag, lattice.y + at);
        z = hn::Load(tag, lattice.z + at);
        for (int i = 0; i < cubeSide; ++i) {
            inner2[i] = outer2[i] = hn::Set(tag, infinite);
            if constexpr (withOwners) innerOwner[i] = outerOwner[i] = hn::Set(IntTag(), -1);
        }
    }
    HWY_INLINE Vec own2(int x) const {
        return hn::MulAdd(y, y, hn::MulAdd(z, z, hn::Set(Tag(), sliceAt(x) * sliceAt(x))));
    }
    Vec y, z, inner2[cubeSide], outer2[cubeSide];
    IntVec innerOwner[cubeSide], outerOwner[cubeSide];
};

// The samples around a cube, in the order of the brick's: -2 s, |s|^2, and minus twice the product of s and its offset,
// where s is the sample from the middle of the cube.
struct Candidates {
    const float *x, *y, *z, *square, *height;
    std::span<const std::uint32_t> picked;  // those that reach the cube
};

// Lowers squared distances to those of a sample; with cubes, where the voxel is in the paper's neighbourhood: a cube
// around the lattice point nearest to the sample.
template <bool cube, class Voxels>
HWY_INLINE void approach(const LayerBlockInput& input, const Candidates& from, std::uint32_t s, const glm::vec3& middle,
                         const Voxels& v, Vec* nearest2) {
    const Tag tag;
    Linear distance2(from.x[s], from.y[s], from.z[s], from.square[s], v.y, v.z);
    glm::vec3 centre(0);
    const auto half = float(input.parameters.cube);
    if constexpr (cube) {
        const auto& places = input.samples.columns().place;
        centre = LayerSamples::nearestLattice({places[0][s], places[1][s], places[2][s]}) - middle;
        const Vec y = hn::Abs(hn::Sub(v.y, hn::Set(tag, centre.y))), z = hn::Abs(hn::Sub(v.z, hn::Set(tag, centre.z)));
        distance2.across =
            hn::IfThenElse(hn::Le(hn::Max(y, z), hn::Set(tag, half)), distance2.across, hn::Set(tag, infinite));
    }
    for (int x = 0; x < cubeSide; ++x)
        if (!cube || std::abs(sliceAt(x) - centre.x) <= half) nearest2[x] = hn::Min(nearest2[x], distance2.at(x));
}

// Samples of one triangle lie in a plane and share their offset. So where A is the squared distance to the nearest of
// them and h the height over the plane, the nearest inner and outer samples are at squared distances
// A + delta^2 + 2 delta h and A + delta^2 - 2 delta h.
template <bool withOwners>
HWY_INLINE void spread(const LayerBlockInput& input, const Candidates& from, std::uint32_t s, const Vec* nearest2,
                       Voxels<withOwners>& v) {
    const auto& columns = input.samples.columns();
    const auto twice = [&](std::size_t axis) { return 2 * columns.offset[axis][s]; };
    const Linear height(twice(0), twice(1), twice(2), from.height[s], v.y, v.z);
    for (int x = 0; x < cubeSide; ++x) {
        const Vec up = height.at(x), inner2 = hn::Add(nearest2[x], up), outer2 = hn::Sub(nearest2[x], up);
        if constexpr (withOwners) {
            const IntTag intTag;
            const IntVec owner = hn::Set(intTag, columns.triangle[s]);
            const auto wins = [&](Vec distance2, Vec best2) {
                return hn::RebindMask(intTag, hn::Lt(distance2, best2));
            };
            v.innerOwner[x] = hn::IfThenElse(wins(inner2, v.inner2[x]), owner, v.innerOwner[x]);
            v.outerOwner[x] = hn::IfThenElse(wins(outer2, v.outer2[x]), owner, v.outerOwner[x]);
        }
        v.inner2[x] = hn::Min(v.inner2[x], inner2);
        v.outer2[x] = hn::Min(v.outer2[x], outer2);
    }
}

template <bool cube, bool withOwners>
HWY_INLINE void applyAll(const LayerBlockInput& input, const Candidates& from, const glm::vec3& middle,
                         Voxels<withOwners>& v) {
    const std::int32_t* triangles = input.samples.columns().triangle.data();
    const std::uint32_t *next = from.picked.data(), *end = next + from.picked.size();
    while (next < end) {
        const std::uint32_t first = *next;
        Vec nearest2[cubeSide];
        for (Vec& some : nearest2) some = hn::Set(Tag(), infinite);
        do approach<cube>(input, from, *next, middle, v, nearest2);
        while (++next < end && triangles[*next] == triangles[first]);
        spread(input, from, first, nearest2, v);
    }
}

// Writes rows of a part of a slice into the block.
template <class D, class T>
HWY_INLINE void putRows(D tag, hn::Vec<D> values, int part, T* corner) {
    alignas(64) T rows[sliceVoxels];
    hn::Store(values, tag, rows);
    const int first = part * int(hn::Lanes(tag));
    for (int i = 0; i < int(hn::Lanes(tag)); i += cubeSide)
        std::memcpy(corner + (first + i) / cubeSide * blockSide, rows + i, cubeSide * sizeof(T));
}

// Eq. 3: from both layers to signed distances. The inside keeps its sign bit where the distance is clamped to zero.
template <bool withOwners>
HWY_INLINE void combine(const Voxels<withOwners>& v, const FillParameters& parameters, int part, float* distances,
                        std::int32_t* triangles) {
    const Tag tag;
    const Vec delta = hn::Set(tag, parameters.delta), delta2 = squareOf(delta);
    const Vec certain2 = hn::Set(tag, parameters.certain * parameters.certain - parameters.delta * parameters.delta);
    for (int x = 0; x < cubeSide; ++x) {
        const int slice = x * blockSide * blockSide;
        const Vec own2 = v.own2(x), inner2 = hn::Min(hn::Add(v.inner2[x], own2), certain2),
                  outer2 = hn::Min(hn::Add(v.outer2[x], own2), certain2);
        const auto inside = hn::Le(inner2, hn::Add(outer2, hn::Set(tag, layerTie)));
        const Vec other2 = hn::Max(hn::Add(hn::Max(inner2, outer2), delta2), hn::Zero(tag));
        const Vec clamped = hn::Max(hn::Sub(hn::Sqrt(other2), delta), hn::Zero(tag));
        const Vec phi = hn::IfThenElse(inside, hn::Neg(clamped), clamped);
        const auto known = hn::Lt(hn::Min(inner2, outer2), certain2);
        putRows(tag, hn::IfThenElse(known, phi, hn::Set(tag, infinite)), part, distances + slice);
        if constexpr (withOwners)
            putRows(IntTag(), hn::IfThenElse(hn::RebindMask(IntTag(), inside), v.outerOwner[x], v.innerOwner[x]), part,
                    triangles + slice);
    }
}

// How far numbers lie beyond the cube's voxels.
inline Vec beyond(Vec at) {
    const Tag tag;
    return hn::Max(hn::Sub(hn::Abs(at), hn::Set(tag, halfCube)), hn::Zero(tag));
}

// Picks the samples that reach a cube: of inner or outer samples that are near enough or, with cubes, by their
// neighbourhood.
template <bool cube>
Candidates pick(const LayerBlockInput& input, const glm::ivec3& inBrick, const glm::vec3& middle,
                LayerScratch& scratch) {
    const Tag tag;
    const hn::RebindToUnsigned<Tag> indexTag;
    const std::size_t lanes = hn::Lanes(tag), size = input.samples.count() + lanes;
    for (auto& column : scratch.columns)
        if (column.size() < size) column.resize(size);
    if (scratch.picked.size() < size) scratch.picked.resize(size);
    const auto& columns = input.samples.columns();
    const Vec reach2 = hn::Set(tag, input.parameters.certain * input.parameters.certain),
              half = hn::Set(tag, float(input.parameters.cube) + halfCube);
    std::uint32_t* picked = scratch.picked.data();
    input.samples.forEachNear(inBrick / cubeSide, 1, [&](std::uint32_t begin, std::uint32_t end) {
        for (std::uint32_t i = begin; i < end; i += std::uint32_t(lanes)) {
            Vec toInner2 = hn::Zero(tag), toOuter2 = toInner2, square = toInner2, height = toInner2, away = toInner2;
            for (std::size_t axis = 0; axis < 3; ++axis) {
                const Vec place = hn::LoadU(tag, columns.place[axis].data() + i),
                          offset = hn::LoadU(tag, columns.offset[axis].data() + i),
                          centre = hn::Set(tag, middle[int(axis)]), at = hn::Sub(place, centre),
                          minusTwice = hn::Mul(at, hn::Set(tag, -2.f));
                if constexpr (cube) {
                    const Vec nearest = hn::Floor(hn::Add(place, hn::Set(tag, 0.5001f)));
                    away = hn::Max(away, hn::Abs(hn::Sub(nearest, centre)));
                } else {
                    const Vec inner = beyond(hn::Sub(at, offset)), outer = beyond(hn::Add(at, offset));
                    toInner2 = hn::MulAdd(inner, inner, toInner2);
                    toOuter2 = hn::MulAdd(outer, outer, toOuter2);
                }
                square = hn::MulAdd(at, at, square);
                height = hn::MulAdd(minusTwice, offset, height);
                hn::StoreU(minusTwice, tag, scratch.columns[axis].data() + i);
            }
            hn::StoreU(square, tag, scratch.columns[3].data() + i);
            hn::StoreU(height, tag, scratch.columns[4].data() + i);
            const Mask reaches = cube ? hn::Le(away, half) : hn::Lt(hn::Min(toInner2, toOuter2), reach2);
            const auto valid = hn::FirstN(indexTag, end - i);
            const auto mask = hn::And(hn::RebindMask(indexTag, reaches), valid);
            hn::StoreU(hn::Compress(hn::Iota(indexTag, i), mask), indexTag, picked);
            picked += hn::CountTrue(indexTag, mask);
        }
    });
    const auto& to = scratch.columns;
    return {to[0].data(), to[1].data(), to[2].data(), to[3].data(), to[4].data(), {scratch.picked.data(), picked}};
}

template <bool cube, bool withOwners>
bool fillCube(const LayerBlockInput& input, const glm::ivec3& inBlock, LayerScratch& scratch, float* distances,
              std::int32_t* triangles) {
    const glm::ivec3 inBrick = input.inBrick + inBlock;
    const glm::vec3 middle = glm::vec3(inBrick) + halfCube;
    const Candidates candidates = pick<cube>(input, inBrick, middle, scratch);
    const int corner = (inBlock.x * blockSide + inBlock.y) * blockSide + inBlock.z;
    if (candidates.picked.empty()) {
        for (int x = 0; x < cubeSide; ++x)
            for (int y = 0; y < cubeSide; ++y)
                std::fill_n(distances + corner + (x * blockSide + y) * blockSide, cubeSide, infinite);
        return false;
    }
    for (int part = 0; part * int(hn::Lanes(Tag())) < sliceVoxels; ++part) {
        Voxels<withOwners> voxels(part);
        applyAll<cube>(input, candidates, middle, voxels);
        combine(voxels, input.parameters, part, distances + corner, withOwners ? triangles + corner : nullptr);
    }
    return true;
}

bool fillLayerBlock(const LayerBlockInput& input, LayerScratch& scratch, float* distances, std::int32_t* triangles) {
    const auto fill = input.parameters.cube > 0 ? (triangles ? fillCube<true, true> : fillCube<true, false>)
                                                : (triangles ? fillCube<false, true> : fillCube<false, false>);
    bool any = false;
    if (!input.samples.anyNear(input.inBrick / cubeSide, cubesPerSide)) return false;
    for (int cube = 0; cube < cubesPerBlock; ++cube)
        any |= fill(input, cubeSide * glm::ivec3(cube / 4, cube / 2 % 2, cube % 2), scratch, distances, triangles);
    return any;
}

const char* targetName() {
    return hwy::TargetName(HWY_TARGET);
}

}  // namespace bilayer::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bilayer {

HWY_EXPORT(fillLayerBlock);
HWY_EXPORT(targetName);

bool fillLayerBlock(const LayerBlockInput& input, LayerScratch& scratch, float* distances, std::int32_t* triangles) {
    return HWY_DYNAMIC_DISPATCH(fillLayerBlock)(input, scratch, distances, triangles);
}

const char* simdName() {
    return HWY_DYNAMIC_DISPATCH(targetName)();
}

}  // namespace bilayer
#endif  // HWY_ONCE
