// SPDX-License-Identifier: Apache-2.0
// Highway compiles the code between HWY_BEFORE_NAMESPACE and HWY_AFTER_NAMESPACE once per instruction set.
#include "sdf/fill/layer_block.h"

#include "sdf/fill/double_layer.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "sdf/fill/layer_block.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <string_view>

#include "sdf/base/compress.h"

HWY_BEFORE_NAMESPACE();
namespace bilayer::detail::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;
namespace {

constexpr int cubeSide = LayerSamples::cellSide;  // voxels
constexpr int sliceVoxels = cubeSide * cubeSide;  // voxels with one x
constexpr int cubesPerSide = blockSide / cubeSide;
constexpr int cubesPerBlock = cubesPerSide * cubesPerSide * cubesPerSide;

/// As many voxels of a slice at once as there are lanes: rows along z.
using Tag = hn::CappedTag<float, sliceVoxels>;
using IntTag = hn::RebindToSigned<Tag>;
using Vec = hn::Vec<Tag>;
using Mask = hn::Mask<Tag>;
using IntVec = hn::Vec<IntTag>;

constexpr float infinite = std::numeric_limits<float>::infinity();
constexpr float halfCube = 0.5f * float(cubeSide - 1);  // from the centre of a cube to its outermost voxels

// Positions of the voxels in a slice, relative to the centre of their cube.
struct CubeLattice {
    alignas(64) float y[sliceVoxels], z[sliceVoxels];
};
constexpr CubeLattice lattice = [] {
    CubeLattice l{};
    for (int i = 0; i < sliceVoxels; ++i) {
        l.y[i] = float(i / cubeSide) - halfCube;
        l.z[i] = float(i % cubeSide) - halfCube;
    }
    return l;
}();

inline float sliceAt(int x) {
    return float(x) - halfCube;
}

// One vector of each slice of a cube, relative to the cube's centre.
struct Voxels {
    explicit Voxels(int part) {
        const auto at = std::size_t(part) * hn::Lanes(Tag());
        y = hn::Load(Tag(), lattice.y + at);
        z = hn::Load(Tag(), lattice.z + at);
    }
    HWY_INLINE Vec square(int x) const {
        return hn::MulAdd(y, y, hn::MulAdd(z, z, hn::Set(Tag(), sliceAt(x) * sliceAt(x))));
    }
    Vec y, z;
};

// The points of a layer near a cube, relative to its centre.
struct LayerPoints {
    LayerPoints(LayerScratch::Layer& memory, std::size_t size) {
        for (auto& column : memory.columns)
            if (column.size() < size) column.resize(size);
        if (memory.picked.size() < size) memory.picked.resize(size);
        x = memory.columns[0].data();
        y = memory.columns[1].data();
        z = memory.columns[2].data();
        halfSquare = memory.columns[3].data();
        picked = memory.picked.data();
    }

    // Stores a vector of points, and selects those closer to the cube's voxels than sqrt(reach2).
    HWY_INLINE void put(std::uint32_t first, Vec px, Vec py, Vec pz, Mask among, Vec reach2) {
        const Tag tag;
        const auto square = [](Vec a, Vec b, Vec c) { return hn::MulAdd(a, a, hn::MulAdd(b, b, hn::Mul(c, c))); };
        const auto beyond = [](Vec at) {
            return hn::Max(hn::Sub(hn::Abs(at), hn::Set(Tag(), halfCube)), hn::Zero(Tag()));
        };
        const hn::RebindToUnsigned<Tag> indexTag;
        const Mask near = hn::And(among, hn::Lt(square(beyond(px), beyond(py), beyond(pz)), reach2));
        const auto numbers = hn::Add(hn::Iota(indexTag, 0), hn::Set(indexTag, first));
        hn::StoreU(px, tag, x + first);
        hn::StoreU(py, tag, y + first);
        hn::StoreU(pz, tag, z + first);
        hn::StoreU(hn::Mul(square(px, py, pz), hn::Set(tag, 0.5f)), tag, halfSquare + first);
        const Compressor<Tag> kept(tag, near);
        kept.store(indexTag, numbers, picked + count);
        count += kept.count();
    }

    float *x, *y, *z, *halfSquare;  // of all points, in the order of the brick's samples
    std::uint32_t* picked;          // indices of the points that reach the cube
    std::size_t count = 0;          // count of `picked`
};

// Finds the layer point nearest to each voxel. It maximizes p . v - |p|^2 / 2, because |v - p|^2 = |v|^2 - 2 (p . v -
// |p|^2 / 2). This costs one multiplication per voxel and point.
template <bool cube, bool withOwners>
struct Nearest {
    HWY_INLINE Nearest(const LayerBlockInput& input, const LayerPoints& points, const glm::vec3& middle,
                       const Voxels& v) {
        const Tag tag;
        for (int x = 0; x < cubeSide; ++x) {
            greatest[x] = hn::Set(tag, -infinite);
            if constexpr (withOwners) owner[x] = hn::Set(IntTag(), -1);
        }
        for (const std::uint32_t p : std::span(points.picked, points.count)) {
            const Vec along = hn::Set(tag, points.x[p]);
            Vec across = hn::MulAdd(v.z, hn::Set(tag, points.z[p]),
                                    hn::MulSub(v.y, hn::Set(tag, points.y[p]), hn::Set(tag, points.halfSquare[p])));
            glm::vec3 centre(0);
            if constexpr (cube) {
                centre = centreOf(input, p) - middle;
                across = hn::IfThenElse(isNear(input, centre, v), across, hn::Set(tag, -infinite));
            }
            for (int x = 0; x < cubeSide; ++x) {
                if (cube && std::abs(sliceAt(x) - centre.x) > float(input.parameters.cube)) continue;
                const Vec some = hn::MulAdd(along, hn::Set(tag, sliceAt(x)), across);
                if constexpr (withOwners)
                    owner[x] = hn::IfThenElse(hn::RebindMask(IntTag(), hn::Gt(some, greatest[x])),
                                              hn::Set(IntTag(), input.samples.columns().triangle[p]), owner[x]);
                greatest[x] = hn::Max(greatest[x], some);
            }
        }
    }

    HWY_INLINE Vec distance2(const Voxels& v, int x) const {
        return hn::NegMulAdd(hn::Set(Tag(), 2.f), greatest[x], v.square(x));
    }

    Vec greatest[cubeSide];
    IntVec owner[cubeSide];

  private:
    // The paper's neighbourhood: a cube of voxels around the lattice point nearest to the sample.
    static glm::vec3 centreOf(const LayerBlockInput& input, std::uint32_t p) {
        const auto& place = input.samples.columns().place;
        return LayerSamples::nearestLattice({place[0][p], place[1][p], place[2][p]});
    }
    static Mask isNear(const LayerBlockInput& input, const glm::vec3& centre, const Voxels& v) {
        const Tag tag;
        const Vec y = hn::Abs(hn::Sub(v.y, hn::Set(tag, centre.y))), z = hn::Abs(hn::Sub(v.z, hn::Set(tag, centre.z)));
        return hn::Le(hn::Max(y, z), hn::Set(tag, float(input.parameters.cube)));
    }
};

// Writes rows of one part of a slice to the block.
template <class D, class T>
HWY_INLINE void putRows(D tag, hn::Vec<D> values, int part, T* corner) {
    alignas(64) T rows[sliceVoxels];
    hn::Store(values, tag, rows);
    const int lanes = int(hn::Lanes(tag)), inRow = std::min(lanes, cubeSide);
    for (int i = 0, at = part * lanes; i < lanes; i += inRow, at += inRow)
        std::memcpy(corner + at / cubeSide * blockSide + at % cubeSide, rows + i, std::size_t(inRow) * sizeof(T));
}

// Eq. 3: combines both layers into signed distances. Inside voxels keep their sign bit where the distance is clamped to
// zero. Counts the voxels that are off the surface and equally near to both layers.
template <class Nearest>
HWY_INLINE void combine(const Nearest& inner, const Nearest& outer, const Voxels& v, const FillParameters& parameters,
                        int part, float* distances, std::int32_t* triangles, std::size_t& undecided) {
    const Tag tag;
    const Vec offSurface2 = hn::Set(tag, (parameters.delta + 0.5f) * (parameters.delta + 0.5f)),
              tie = hn::Set(tag, layerTie);
    const Vec delta = hn::Set(tag, parameters.delta), certain2 = hn::Set(tag, parameters.certain * parameters.certain);
    for (int x = 0; x < cubeSide; ++x) {
        const int slice = x * blockSide * blockSide;
        const Vec inner2 = hn::Min(inner.distance2(v, x), certain2), outer2 = hn::Min(outer.distance2(v, x), certain2);
        // If only the outer layer is within the certain distance, a tie does not mean inside.
        const auto inside = hn::And(hn::Lt(inner2, certain2), hn::Le(inner2, hn::Add(outer2, tie)));
        const Vec other2 = hn::Max(hn::Max(inner2, outer2), hn::Zero(tag));
        const Vec clamped = hn::Max(hn::Sub(hn::Sqrt(other2), delta), hn::Zero(tag));
        const Vec phi = hn::IfThenElse(inside, hn::Neg(clamped), clamped);
        const auto known = hn::Lt(hn::Min(inner2, outer2), certain2);
        const auto tied =
            hn::And(known, hn::And(hn::Gt(other2, offSurface2), hn::Le(hn::Abs(hn::Sub(inner2, outer2)), tie)));
        undecided += hn::CountTrue(tag, tied);
        putRows(tag, hn::IfThenElse(known, phi, hn::Set(tag, infinite)), part, distances + slice);
        if (triangles)
            putRows(IntTag(), hn::IfThenElse(hn::RebindMask(IntTag(), inside), outer.owner[x], inner.owner[x]), part,
                    triangles + slice);
    }
}

// Selects the points of both layers that reach a cube. With the paper's cubes, selects those whose neighbourhood
// overlaps it.
template <bool cube>
HWY_INLINE void pick(const LayerBlockInput& input, const glm::vec3& middle,
                     std::span<const LayerSamples::SampleRange> ranges, LayerPoints& inner, LayerPoints& outer) {
    const Tag tag;
    const SampleColumns& columns = input.samples.columns();
    const float* places[] = {columns.place[0].data(), columns.place[1].data(), columns.place[2].data()};
    const float* offsets[] = {columns.offset[0].data(), columns.offset[1].data(), columns.offset[2].data()};
    const Vec reach2 = hn::Set(tag, input.parameters.certain * input.parameters.certain),
              half = hn::Set(tag, float(input.parameters.cube) + halfCube),
              centre[] = {hn::Set(tag, middle.x), hn::Set(tag, middle.y), hn::Set(tag, middle.z)};
    for (const LayerSamples::SampleRange& range : ranges)
        for (std::uint32_t i = range.begin; i < range.end; i += std::uint32_t(hn::Lanes(tag))) {
            Mask among = hn::FirstN(tag, range.end - i);
            Vec in[3], out[3];
            for (int axis = 0; axis < 3; ++axis) {
                const Vec place = hn::LoadU(tag, places[axis] + i), offset = hn::LoadU(tag, offsets[axis] + i),
                          at = hn::Sub(place, centre[axis]);
                if constexpr (cube) {
                    const Vec nearest = hn::Floor(hn::Add(place, hn::Set(tag, 0.5001f)));
                    among = hn::And(among, hn::Le(hn::Abs(hn::Sub(nearest, centre[axis])), half));
                }
                in[axis] = hn::Sub(at, offset);
                out[axis] = hn::Add(at, offset);
            }
            inner.put(i, in[0], in[1], in[2], among, reach2);
            outer.put(i, out[0], out[1], out[2], among, reach2);
        }
}

template <bool cube, bool withOwners>
bool fillCube(const LayerBlockInput& input, const glm::ivec3& inBlock, LayerScratch& scratch, LayerPoints inner,
              LayerPoints outer, float* distances, std::int32_t* triangles) {
    const glm::ivec3 inBrick = input.inBrick + inBlock;
    const glm::vec3 middle = glm::vec3(inBrick) + halfCube;
    pick<cube>(input, middle, input.samples.near(inBrick / cubeSide, 1, scratch.near), inner, outer);
    const int corner = (inBlock.x * blockSide + inBlock.y) * blockSide + inBlock.z;
    if (inner.count + outer.count == 0) {
        for (int x = 0; x < cubeSide; ++x)
            for (int y = 0; y < cubeSide; ++y)
                std::fill_n(distances + corner + (x * blockSide + y) * blockSide, cubeSide, infinite);
        return false;
    }
    for (int part = 0; part * int(hn::Lanes(Tag())) < sliceVoxels; ++part) {
        const Voxels voxels(part);
        const Nearest<cube, withOwners> nearestInner(input, inner, middle, voxels),
            nearestOuter(input, outer, middle, voxels);
        combine(nearestInner, nearestOuter, voxels, input.parameters, part, distances + corner,
                withOwners ? triangles + corner : nullptr, scratch.undecided);
    }
    return true;
}

bool fillLayerBlock(const LayerBlockInput& input, LayerScratch& scratch, float* distances, std::int32_t* triangles) {
    const auto fill = input.parameters.cube > 0 ? (triangles ? fillCube<true, true> : fillCube<true, false>)
                                                : (triangles ? fillCube<false, true> : fillCube<false, false>);
    bool any = false;
    if (input.samples.near(input.inBrick / cubeSide, cubesPerSide, scratch.near).empty()) return false;
    const std::size_t size = input.samples.count() + hn::Lanes(Tag());
    const LayerPoints inner(scratch.inner, size), outer(scratch.outer, size);
    for (int cube = 0; cube < cubesPerBlock; ++cube)
        any |= fill(input, cubeSide * glm::ivec3(cube / 4, cube / 2 % 2, cube % 2), scratch, inner, outer, distances,
                    triangles);
    return any;
}

const char* targetName() {
    return hwy::TargetName(HWY_TARGET);
}

}  // namespace
}  // namespace bilayer::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bilayer::detail {

HWY_EXPORT(fillLayerBlock);
HWY_EXPORT(targetName);

bool fillLayerBlock(const LayerBlockInput& input, LayerScratch& scratch, float* distances, std::int32_t* triangles) {
    return HWY_DYNAMIC_DISPATCH(fillLayerBlock)(input, scratch, distances, triangles);
}

const char* simdName() {
    const char* name = HWY_DYNAMIC_DISPATCH(targetName)();
    return std::string_view(name).starts_with("AVX3") ? "AVX-512" : name;  // Highway's word is its own
}

}  // namespace bilayer::detail
#endif  // HWY_ONCE
