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

constexpr int cubeSide = 4;                       // voxels
constexpr int sliceVoxels = cubeSide * cubeSide;  // of one x
constexpr int cubesPerSide = blockSide / cubeSide;
constexpr int cubesPerBlock = cubesPerSide * cubesPerSide * cubesPerSide;

/// As many voxels of a slice at once as there are lanes: rows along z.
using Tag = hn::CappedTag<float, sliceVoxels>;
using IntTag = hn::RebindToSigned<Tag>;
using Vec = hn::Vec<Tag>;
using Mask = hn::Mask<Tag>;
using IntVec = hn::Vec<IntTag>;

/// Groups with fewer runs than this are applied without a look at what they could improve.
constexpr std::uint32_t runsWorthALook = 5;
constexpr float infinite = std::numeric_limits<float>::infinity();

// Places of a slice's voxels in their cube.
struct Lattice {
    alignas(64) float y[sliceVoxels], z[sliceVoxels];
};
constexpr Lattice lattice = [] {
    Lattice l{};
    for (int i = 0; i < sliceVoxels; ++i) {
        l.y[i] = float(i / cubeSide);
        l.z[i] = float(i % cubeSide);
    }
    return l;
}();

// A number for each slice.
struct Slices {
    using Tag = hn::CappedTag<float, cubeSide>;

    // make(x - centre) of the slices from x = first on
    template <class Make>
    HWY_INLINE Slices(float first, float centre, Make make) {
        const Tag tag;
        for (std::size_t i = 0; i < std::size_t(cubeSide); i += hn::Lanes(tag))
            hn::Store(make(hn::Sub(hn::Iota(tag, first + float(i)), hn::Set(tag, centre))), tag, of + i);
    }
    alignas(16) float of[cubeSide];
};

// One vector's part of each slice of a cube: where its voxels are, and what was found for them. Distances are squared
// and less delta^2.
template <bool withOwners>
struct Voxels {
    Voxels(const glm::vec3& first, int part, float farthest2) {
        const Tag tag;
        const auto at = std::size_t(part) * hn::Lanes(tag);
        x = first.x;
        y = hn::Add(hn::Load(tag, lattice.y + at), hn::Set(tag, first.y));
        z = hn::Add(hn::Load(tag, lattice.z + at), hn::Set(tag, first.z));
        for (int i = 0; i < cubeSide; ++i) {
            inner2[i] = outer2[i] = hn::Set(tag, farthest2);
            if constexpr (withOwners) innerOwner[i] = outerOwner[i] = hn::Set(IntTag(), -1);
        }
    }
    float x;
    Vec y, z, inner2[cubeSide], outer2[cubeSide];
    IntVec innerOwner[cubeSide], outerOwner[cubeSide];
};

inline Vec squareOf(Vec v) {
    return hn::Mul(v, v);
}

// The paper's neighbourhood: voxels of a cube around the lattice point nearest to the sample.
struct Neighbourhood {
    glm::vec3 centre;
    float half;
};

// Squared distances to a sample: along x for each slice, and across. Infinite outside of a neighbourhood, if there is
// one.
template <bool cube>
struct Measured {
    template <class Voxels>
    HWY_INLINE Measured(const Voxels& v, const glm::vec3& place, const Neighbourhood& near = {})
        : along2(v.x, place.x, [](auto dx) { return hn::Mul(dx, dx); }) {
        const Tag tag;
        const Vec dy = hn::Sub(v.y, hn::Set(tag, place.y)), dz = hn::Sub(v.z, hn::Set(tag, place.z));
        across2 = hn::MulAdd(dy, dy, squareOf(dz));
        if constexpr (cube) {
            const Vec y = hn::Abs(hn::Sub(v.y, hn::Set(tag, near.centre.y))),
                      z = hn::Abs(hn::Sub(v.z, hn::Set(tag, near.centre.z)));
            across2 = hn::IfThenElse(hn::Le(hn::Max(y, z), hn::Set(tag, near.half)), across2, hn::Set(tag, infinite));
            for (int x = 0; x < cubeSide; ++x)
                if (std::abs(v.x + float(x) - near.centre.x) > near.half) along2.of[x] = infinite;
        }
    }
    HWY_INLINE Vec at(int x) const { return hn::Add(hn::Set(Tag(), along2.of[x]), across2); }

    Slices along2;
    Vec across2;
};

template <bool cube, bool withOwners>
HWY_INLINE void apply(const LayerSamples& samples, const LayerRun& run, float half, Voxels<withOwners>& v) {
    const Tag tag;
    const glm::vec3* places = samples.places().data();
    const glm::vec3* cells = samples.cells().data();
    const auto measure = [&](std::uint32_t s) {
        return Measured<cube>(v, places[s], cube ? Neighbourhood{cells[s], half} : Neighbourhood{});
    };
    Vec nearest2[cubeSide];
    {
        const auto first = measure(run.begin);
        for (int x = 0; x < cubeSide; ++x) nearest2[x] = first.at(x);
    }
    for (std::uint32_t s = run.begin + 1; s < run.end; ++s) {
        const auto next = measure(s);
        for (int x = 0; x < cubeSide; ++x) nearest2[x] = hn::Min(nearest2[x], next.at(x));
    }
    // 2 delta times the height over the plane
    const glm::vec3 &place = places[run.begin], &normal = run.twiceOffset;
    const Slices along(v.x, place.x, [&](auto dx) { return hn::Mul(dx, hn::Set(Slices::Tag(), normal.x)); });
    const Vec across = hn::MulAdd(hn::Sub(v.y, hn::Set(tag, place.y)), hn::Set(tag, normal.y),
                                  hn::Mul(hn::Sub(v.z, hn::Set(tag, place.z)), hn::Set(tag, normal.z)));
    for (int x = 0; x < cubeSide; ++x) {
        const Vec height = hn::Add(hn::Set(tag, along.of[x]), across);
        const Vec inner2 = hn::Add(nearest2[x], height), outer2 = hn::Sub(nearest2[x], height);
        if constexpr (withOwners) {
            const IntTag intTag;
            const IntVec owner = hn::Set(intTag, run.triangle);
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

// Upper bounds of the distances to both layers.
struct Bounds {
    template <bool withOwners>
    Bounds(const Voxels<withOwners>& v, float delta2) {
        const Tag tag;
        for (int x = 0; x < cubeSide; ++x) {
            inner[x] = hn::Sqrt(hn::Max(hn::Add(v.inner2[x], hn::Set(tag, delta2)), hn::Zero(tag)));
            outer[x] = hn::Sqrt(hn::Max(hn::Add(v.outer2[x], hn::Set(tag, delta2)), hn::Zero(tag)));
        }
    }
    Vec inner[cubeSide], outer[cubeSide];
};

// Whether a ball may hold a sample nearer to some voxel than what was found: |p - centre| - radius < bound.
template <class Voxels>
HWY_INLINE bool mayImprove(const Voxels& v, const glm::vec3& centre, float radius, float delta2, const Vec* bound,
                           const Vec* best2) {
    const Tag tag;
    const Measured<false> distance2(v, centre);
    // squared: |p - centre|^2 < bound^2 + 2 radius bound + radius^2
    const Vec twice = hn::Set(tag, 2 * radius), rest = hn::Set(tag, delta2 + radius * radius);
    const auto mayAt = [&](int x) {
        return hn::Lt(distance2.at(x), hn::Add(hn::MulAdd(twice, bound[x], best2[x]), rest));
    };
    Mask may = mayAt(0);
    for (int x = 1; x < cubeSide; ++x) may = hn::Or(may, mayAt(x));
    return !hn::AllFalse(tag, may);
}

template <bool cube, bool withOwners>
HWY_INLINE void applyGroups(const LayerBlockInput& input, std::span<const std::uint32_t> groups,
                            Voxels<withOwners>& v) {
    const LayerRun* runs = input.samples.runs().data();
    const float half = float(input.parameters.cube), delta2 = input.parameters.delta * input.parameters.delta;
    bool large = false;
    for (const std::uint32_t index : groups) {
        const LayerGroup& group = input.samples.groups()[index];
        const bool worthALook = group.end - group.begin >= runsWorthALook;
        large |= worthALook;
        const std::uint32_t end = worthALook ? group.begin + 1 : group.end;
        for (std::uint32_t r = group.begin; r < end; ++r) apply<cube>(input.samples, runs[r], half, v);
    }
    if (!large) return;
    const Bounds bounds(v, delta2);
    for (const std::uint32_t index : groups) {
        const LayerGroup& group = input.samples.groups()[index];
        if (group.end - group.begin < runsWorthALook) continue;
        if (!mayImprove(v, group.sample - group.offset, group.radius, delta2, bounds.inner, v.inner2) &&
            !mayImprove(v, group.sample + group.offset, group.radius, delta2, bounds.outer, v.outer2))
            continue;
        for (std::uint32_t r = group.begin + 1; r < group.end; ++r) apply<cube>(input.samples, runs[r], half, v);
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
        const auto inside = hn::Le(v.inner2[x], hn::Add(v.outer2[x], hn::Set(tag, layerTie)));
        const Vec other2 = hn::Max(hn::Add(hn::Max(v.inner2[x], v.outer2[x]), delta2), hn::Zero(tag));
        const Vec clamped = hn::Max(hn::Sub(hn::Sqrt(other2), delta), hn::Zero(tag));
        const Vec phi = hn::IfThenElse(inside, hn::Neg(clamped), clamped);
        const auto known = hn::Lt(hn::Min(v.inner2[x], v.outer2[x]), certain2);
        putRows(tag, hn::IfThenElse(known, phi, hn::Set(tag, infinite)), part, distances + slice);
        if constexpr (withOwners)
            putRows(IntTag(), hn::IfThenElse(hn::RebindMask(IntTag(), inside), v.outerOwner[x], v.innerOwner[x]), part,
                    triangles + slice);
    }
}

template <bool cube, bool withOwners>
void fillCube(const LayerBlockInput& input, std::span<const std::uint32_t> groups, const glm::ivec3& inBlock,
              float* distances, std::int32_t* triangles) {
    const FillParameters& parameters = input.parameters;
    const float farthest2 = parameters.certain * parameters.certain - parameters.delta * parameters.delta;
    const int corner = (inBlock.x * blockSide + inBlock.y) * blockSide + inBlock.z;
    for (int part = 0; part * int(hn::Lanes(Tag())) < sliceVoxels; ++part) {
        Voxels<withOwners> voxels(input.inBrick + glm::vec3(inBlock), part, farthest2);
        applyGroups<cube>(input, groups, voxels);
        combine(voxels, parameters, part, distances + corner, withOwners ? triangles + corner : nullptr);
    }
}

using CubeGroups = std::array<std::span<const std::uint32_t>, cubesPerBlock>;

// The groups that reach each cube: the balls around their inner or outer samples must, and their slab.
CubeGroups binCubes(const LayerBlockInput& input, LayerScratch& scratch) {
    const Tag tag;
    const std::size_t lanes = hn::Lanes(tag), count = input.reaching.size(),
                      stride = (count + lanes - 1) / lanes * lanes;
    enum Row { inner, outer = inner + 3, normal = outer + 3, reach = normal + 3, slab, rows };
    // columns beyond the last group reach nothing
    scratch.columns.resize(stride * rows);
    float* columns = scratch.columns.data();
    // the paper's cube of (2K + 1)^3 voxels is around the sample itself, and sticks out of the ball
    const bool cubes = input.parameters.cube > 0;
    const float slabReach = input.parameters.reach * (cubes ? std::sqrt(3.f) : 1.f),
                ballReach = cubes ? slabReach : input.parameters.certain;
    for (std::size_t i = 0; i < count; ++i) {
        const LayerGroup& group = input.samples.groups()[input.reaching[i]];
        const glm::vec3 at = group.sample - input.inBrick, offset = cubes ? glm::vec3(0) : group.offset;
        const auto put = [&](int row, float value) { columns[std::size_t(row) * stride + i] = value; };
        for (int axis = 0; axis < 3; ++axis) {
            put(inner + axis, at[axis] - offset[axis]);
            put(outer + axis, at[axis] + offset[axis]);
            put(normal + axis, group.normal[axis]);
        }
        put(reach, group.radius + ballReach);
        put(slab, group.thickness + slabReach);
    }
    for (std::size_t i = count; i < stride; ++i)
        for (int row = 0; row < rows; ++row) columns[std::size_t(row) * stride + i] = -1;
    scratch.groups.resize(count * cubesPerBlock);
    std::size_t ends[cubesPerBlock];
    for (int cube = 0; cube < cubesPerBlock; ++cube) ends[cube] = std::size_t(cube) * count;
    constexpr float half = 0.5f * float(cubeSide - 1);
    for (std::size_t i = 0; i < count; i += lanes) {
        const auto row = [&](int r) { return hn::LoadU(tag, columns + std::size_t(r) * stride + i); };
        Vec toInner2[3][cubesPerSide], toOuter2[3][cubesPerSide], height[3][cubesPerSide];
        Vec slabWidth = row(slab);
        for (int axis = 0; axis < 3; ++axis) {
            const Vec in = row(inner + axis), out = row(outer + axis), up = row(normal + axis);
            const Vec centre = hn::Mul(hn::Set(tag, 0.5f), hn::Add(in, out));
            for (int side = 0; side < cubesPerSide; ++side) {
                const Vec middle = hn::Set(tag, float(side * cubeSide) + half);
                const auto away2 = [&](Vec from) {
                    return squareOf(
                        hn::Max(hn::Sub(hn::Abs(hn::Sub(middle, from)), hn::Set(tag, half)), hn::Zero(tag)));
                };
                toInner2[axis][side] = away2(in);
                toOuter2[axis][side] = away2(out);
                height[axis][side] = hn::Mul(hn::Sub(middle, centre), up);
            }
            slabWidth = hn::MulAdd(hn::Set(tag, half), hn::Abs(up), slabWidth);
        }
        const Vec reaches = row(reach), reach2 = squareOf(reaches);
        const Mask real = hn::Gt(reaches, hn::Zero(tag));
        for (int cube = 0; cube < cubesPerBlock; ++cube) {
            const int a = cube / 4, b = cube / 2 % 2, c = cube % 2;
            const auto sum = [&](const Vec(&of)[3][cubesPerSide]) {
                return hn::Add(hn::Add(of[0][a], of[1][b]), of[2][c]);
            };
            const Mask ball = hn::Lt(hn::Min(sum(toInner2), sum(toOuter2)), reach2);
            const Mask plane = hn::Lt(hn::Abs(sum(height)), slabWidth);
            std::uint8_t bytes[8] = {};
            hn::StoreMaskBits(tag, hn::And(real, hn::And(ball, plane)), bytes);
            std::uint64_t bits;
            std::memcpy(&bits, bytes, sizeof bits);
            std::uint32_t* to = scratch.groups.data() + ends[cube];
            ends[cube] += std::size_t(std::popcount(bits));
            for (; bits != 0; bits &= bits - 1) *to++ = input.reaching[i + std::size_t(std::countr_zero(bits))];
        }
    }
    CubeGroups groups;
    for (int cube = 0; cube < cubesPerBlock; ++cube)
        groups[std::size_t(cube)] = {scratch.groups.data() + std::size_t(cube) * count,
                                     scratch.groups.data() + ends[cube]};
    return groups;
}

void fillLayerBlock(const LayerBlockInput& input, LayerScratch& scratch, float* distances, std::int32_t* triangles) {
    const CubeGroups groups = binCubes(input, scratch);
    for (int cube = 0; cube < cubesPerBlock; ++cube) {
        const glm::ivec3 inBlock = cubeSide * glm::ivec3(cube / 4, cube / 2 % 2, cube % 2);
        const auto fill = input.parameters.cube > 0 ? (triangles ? fillCube<true, true> : fillCube<true, false>)
                                                    : (triangles ? fillCube<false, true> : fillCube<false, false>);
        fill(input, groups[std::size_t(cube)], inBlock, distances, triangles);
    }
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

void fillLayerBlock(const LayerBlockInput& input, LayerScratch& scratch, float* distances, std::int32_t* triangles) {
    HWY_DYNAMIC_DISPATCH(fillLayerBlock)(input, scratch, distances, triangles);
}

const char* simdName() {
    return HWY_DYNAMIC_DISPATCH(targetName)();
}

}  // namespace bilayer
#endif  // HWY_ONCE
