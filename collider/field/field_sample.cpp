// Field sampling, single and in batches. cl/field.cl samples in the same way, operation by operation.
//
// A place is a fixed-point number along each axis. Its upper word is the block; its lower word is the voxel in the
// block and the fraction to the next voxel. The eight voxels around a place are interpolated in two vectors of four:
// along x first, then y, then z. The gradient is a by-product. Voxels outside the band are NaN, which propagates to the
// result. Highway compiles the part between HWY_BEFORE_NAMESPACE and HWY_AFTER_NAMESPACE once for each instruction set.
// All of them give the same bytes.
// Tested by tests/collider/field.cpp.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "collider/field/field_sample.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <array>
#include <bit>
#include <cstring>
#include <glm/geometric.hpp>

#include <bilayer/collider/field.h>
#include "collider/field/batch.h"
#include "collider/field/field_data.h"

#ifndef BILAYER_COLLIDER_FIELD_SAMPLE_ONCE
#define BILAYER_COLLIDER_FIELD_SAMPLE_ONCE

namespace bilayer {

using namespace detail;

namespace {

constexpr float infinity = std::numeric_limits<float>::infinity();
constexpr float cellDiagonal = FieldData::cellDiagonal;

// Samples are stored as four consecutive floats and a bool.
static_assert(offsetof(Sample, distance) == 0 && offsetof(Sample, gradient) == sizeof(float));

// Max error of the interpolant for values with Lipschitz constant 1. It is the weighted mean distance to the eight
// voxels, which is at most its root mean square [voxels].
float interpolationError(const glm::vec3& fraction) {
    const glm::vec3 spread = fraction * (1.f - fraction);
    return std::sqrt(spread.x + spread.y + spread.z);
}

// Bounds are rounded down, against the single-precision rounding of the voxel size and of the bound itself.
constexpr double downward = 1 - 0x1p-22;

// A point outside the directory's box first has to reach the box. There it is at most a cell's diagonal from a voxel
// outside the band.
float boundOutside(const FieldData& field, const glm::dvec3& local) {
    const double way = glm::distance(local, glm::clamp(local, glm::dvec3(0), field.extent()));
    if (!std::isfinite(way)) return infinity;
    const double bound = (way - double(cellDiagonal)) * double(field.voxelSize) + double(field.exteriorWidth);
    return float(std::clamp(downward * bound, 0., double(std::numeric_limits<float>::max())));
}

// The nearest voxel of the block is outside the band. It is half a cell's diagonal away, or a whole one if the cell
// ends in another block.
float boundInEmptyBlock(const FieldData& field, bool inside, const glm::dvec3& local) {
    const glm::dvec3 rest = local - double(FieldFrame::side) * glm::floor(local / double(FieldFrame::side));
    const bool ownCell = std::max({rest.x, rest.y, rest.z}) <= double(FieldFrame::side - 1);
    const float width = inside ? field.interiorWidth : field.exteriorWidth;
    const float besideBand = width - (ownCell ? 0.5f : 1.f) * cellDiagonal * field.voxelSize;
    const float bound = std::max({0.f, besideBand, field.voxelSize * field.clearanceAt(local)});
    return inside ? -bound : bound;
}

// One of the cell's voxels is outside the band.
float boundBesideBand(const FieldData& field, float distance, const glm::dvec3& local) {
    const float besideBand =
        (distance < 0 ? field.interiorWidth : field.exteriorWidth) - cellDiagonal * field.voxelSize;
    const float between =
        std::abs(distance) - field.voxelSize * interpolationError(glm::vec3(local - glm::floor(local)));
    const float bound = std::max({0.f, besideBand, between, field.voxelSize * field.clearanceAt(local)});
    return std::copysign(bound, distance);
}

}  // namespace
}  // namespace bilayer

#endif

// wider vectors than those of the baseline instruction set are only passed between inlined functions
#pragma GCC diagnostic ignored "-Wpsabi"

HWY_BEFORE_NAMESPACE();
namespace bilayer::detail::HWY_NAMESPACE {

namespace {
using Words [[gnu::vector_size(16)]] = std::uint32_t;
using FourDoubles [[gnu::vector_size(32)]] = double;
using TwoFloats [[gnu::vector_size(32)]] = float;  // of two places
using TwoInts [[gnu::vector_size(32)]] = std::int32_t;

constexpr int fractionBits = FieldData::fractionBits;
// Prefetch distances of single samples: two cache lines ahead, and the block after the next.
constexpr int rowsAhead = 4, blocksAhead = 2;
/// The upper word of a place in the directory's first block.
constexpr auto firstBlock = std::uint32_t(std::bit_cast<std::uint64_t>(FieldData::fixedPoint) >> 32);
constexpr int xStep = FieldFrame::stride * FieldFrame::stride, yStep = FieldFrame::stride;

template <class Word, class Element>
HWY_INLINE Word load(const Element* from) {
    Word word;
    std::memcpy(&word, from, sizeof word);
    return word;
}

// Conversions in one instruction each: GCC 12 needs more for its own vector types.
HWY_INLINE Doubles lowerAsDoubles(Floats v) {
#if HWY_ARCH_X86 && HWY_COMPILER_GCC_ACTUAL
    return __builtin_ia32_cvtps2pd(v);
#else
    return Doubles{v[0], v[1]};
#endif
}
HWY_INLINE FourDoubles asDoubles(Floats v) {
#if HWY_ARCH_X86 && HWY_TARGET <= HWY_AVX2 && HWY_COMPILER_GCC_ACTUAL
    return __builtin_ia32_cvtps2pd256(v);
#else
    return __builtin_convertvector(v, FourDoubles);
#endif
}

/// A place along the three axes, in fixed point.
struct Place {
    /// In the directory. Negative, huge and NaN coordinates are all out of its range.
    std::array<std::uint32_t, 3> block;
    std::array<std::uint32_t, 3> inBlock;  ///< the voxel in the upper bits, the fraction to the next in the lower ones
    Floats fraction;                       ///< as floats: x, y, y, z
};

HWY_INLINE Floats fractionOf(const FieldData& field, Words inBlock) {
    return __builtin_convertvector(reinterpret_cast<Ints>(inBlock) & field.lanes.fraction, Floats) *
           field.lanes.fractionUnit;
}

/// From fixed-point numbers in the lower bits of doubles. The blocks are computed in general-purpose registers, in
/// parallel with the vector units, which the interpolation keeps busy.
HWY_INLINE Place placeOf(const FieldData& field, Doubles xy, Doubles yz) {
    const auto words = [](double fixed) { return std::bit_cast<std::uint64_t>(fixed); };
    const std::uint64_t x = words(xy[0]), y = words(yz[0]), z = words(yz[1]);
    return {
        {std::uint32_t(x >> 32) - firstBlock, std::uint32_t(y >> 32) - firstBlock, std::uint32_t(z >> 32) - firstBlock},
        {std::uint32_t(x), std::uint32_t(y), std::uint32_t(z)},
        fractionOf(field,
                   __builtin_shufflevector(reinterpret_cast<Words>(xy), reinterpret_cast<Words>(yz), 0, 2, 4, 6))};
}

/// Two loads of eight bytes give [x, y] and [y, z].
HWY_INLINE Place placeOf(const FieldData& field, const glm::vec3& point) {
    const Doubles xy{load<double>(&point.x), 0}, yz{load<double>(&point.y), 0};
    return placeOf(field, lowerAsDoubles(reinterpret_cast<Floats>(xy)) * field.lanes.perMetre + field.lanes.offsetXy,
                   lowerAsDoubles(reinterpret_cast<Floats>(yz)) * field.lanes.perMetre + field.lanes.offsetYz);
}

/// @param local  from the directory's first voxel [voxels]
HWY_INLINE Place placeOf(const FieldData& field, const glm::dvec3& local) {
    constexpr double zero = FieldData::fixedPoint;
    return placeOf(field, Doubles{local.x, local.y} + zero, Doubles{local.y, local.z} + zero);
}

/// The voxels around a place at its lower and at its upper x: (y, z), (y, z + 1), (y + 1, z), (y + 1, z + 1). For two
/// places, one after the other.
template <class Vector>
struct Cell {
    Vector low, high;
    bool beyond;  ///< fixed16: some are outside the band; float32 voxels there are NaN instead
};

// The lower or upper halves, and the even or odd lanes, of two vectors, in groups of four lanes.
HWY_INLINE Floats lowerHalves(Floats a, Floats b) {
    return __builtin_shufflevector(a, b, 0, 1, 4, 5);
}
HWY_INLINE Floats upperHalves(Floats a, Floats b) {
    return __builtin_shufflevector(a, b, 2, 3, 6, 7);
}
HWY_INLINE Floats evenLanes(Floats a, Floats b) {
    return __builtin_shufflevector(a, b, 0, 2, 4, 6);
}
HWY_INLINE Floats oddLanes(Floats a, Floats b) {
    return __builtin_shufflevector(a, b, 1, 3, 5, 7);
}
HWY_INLINE TwoFloats lowerHalves(TwoFloats a, TwoFloats b) {
    return __builtin_shufflevector(a, b, 0, 1, 8, 9, 4, 5, 12, 13);
}
HWY_INLINE TwoFloats upperHalves(TwoFloats a, TwoFloats b) {
    return __builtin_shufflevector(a, b, 2, 3, 10, 11, 6, 7, 14, 15);
}
HWY_INLINE TwoFloats evenLanes(TwoFloats a, TwoFloats b) {
    return __builtin_shufflevector(a, b, 0, 2, 8, 10, 4, 6, 12, 14);
}
HWY_INLINE TwoFloats oddLanes(TwoFloats a, TwoFloats b) {
    return __builtin_shufflevector(a, b, 1, 3, 9, 11, 5, 7, 13, 15);
}
// The first three lanes of `a` and the first lane of `b`.
HWY_INLINE Floats withFourth(Floats a, Floats b) {
#if HWY_ARCH_X86 && HWY_TARGET <= HWY_SSE4 && HWY_COMPILER_GCC_ACTUAL
    return __builtin_ia32_insertps128(a, b, 3 << 4);
#else
    return __builtin_shufflevector(a, b, 0, 1, 2, 4);
#endif
}
HWY_INLINE TwoFloats withFourth(TwoFloats a, TwoFloats b) {
    return __builtin_shufflevector(a, b, 0, 1, 2, 8, 4, 5, 6, 12);
}
HWY_INLINE TwoFloats both(Floats a, Floats b) {
    return __builtin_shufflevector(a, b, 0, 1, 2, 3, 4, 5, 6, 7);
}

/// Two neighbours along z, and the two next to them along y.
HWY_INLINE Floats loadPairs(const float* v) {
    using Pair [[gnu::vector_size(8)]] = float;
    return __builtin_shufflevector(load<Pair>(v), load<Pair>(v + yStep), 0, 1, 2, 3);
}

HWY_INLINE Cell<Floats> loadCell(const float* v) {
    return {loadPairs(v), loadPairs(v + xStep), false};
}

HWY_INLINE Cell<TwoFloats> loadCells(const float* v, const float* w) {
    return {both(loadPairs(v), loadPairs(w)), both(loadPairs(v + xStep), loadPairs(w + xStep)), false};
}

using Steps [[gnu::vector_size(16)]] = std::int16_t;  // of all eight voxels

HWY_INLINE Steps loadSteps(const std::int16_t* v) {
    const Ints pairs{load<std::int32_t>(v), load<std::int32_t>(v + yStep), load<std::int32_t>(v + xStep),
                     load<std::int32_t>(v + xStep + yStep)};
    return reinterpret_cast<Steps>(pairs);
}

/// Whether some of the steps are one of the two marks, which are adjacent modulo 2^16.
HWY_INLINE bool anyBeyondBand(Steps steps) {
    static_assert(FieldLayout::beyondOutside == INT16_MAX && FieldLayout::beyondInside == INT16_MIN);
    using Ring [[gnu::vector_size(16)]] = std::uint16_t;
    using Long [[gnu::vector_size(16)]] = std::int64_t;
    const auto shifted = reinterpret_cast<Steps>(reinterpret_cast<Ring>(steps) + std::uint16_t(1));
    const Long marked = reinterpret_cast<Long>(shifted < INT16_MIN + 2);
    return (marked[0] | marked[1]) != 0;
}

HWY_INLINE TwoFloats toFloats(Steps steps) {
    return __builtin_convertvector(__builtin_convertvector(steps, TwoInts), TwoFloats);
}

HWY_INLINE Cell<Floats> loadCell(const std::int16_t* v) {
    const Steps steps = loadSteps(v);
    const TwoFloats values = toFloats(steps);
    return {__builtin_shufflevector(values, values, 0, 1, 2, 3), __builtin_shufflevector(values, values, 4, 5, 6, 7),
            anyBeyondBand(steps)};
}

HWY_INLINE Cell<TwoFloats> loadCells(const std::int16_t* v, const std::int16_t* w) {
    const Steps first = loadSteps(v), second = loadSteps(w);
    return {toFloats(__builtin_shufflevector(first, second, 0, 1, 2, 3, 8, 9, 10, 11)),
            toFloats(__builtin_shufflevector(first, second, 4, 5, 6, 7, 12, 13, 14, 15)),
            anyBeyondBand(first) || anyBeyondBand(second)};
}

/// The value and its gradient per voxel. The fractions of the place are in all lanes.
template <class Vector>
HWY_INLINE Vector interpolate(const Cell<Vector>& cell, Vector x, Vector y, Vector z) {
    const Vector dx = cell.high - cell.low, at = cell.low + x * dx;
    // values at z and z + 1, then their slopes along x
    const Vector y0 = lowerHalves(at, dx), y1 = upperHalves(at, dx);
    const Vector dy = y1 - y0, between = y0 + y * dy;
    // value, slope along x, slope along y
    const Vector z0 = evenLanes(between, dy), z1 = oddLanes(between, dy);
    const Vector dz = z1 - z0, found = z0 + z * dz;
    return withFourth(found, dz);
}

HWY_INLINE Floats interpolate(const Cell<Floats>& cell, Floats fraction) {
    return interpolate(cell, __builtin_shufflevector(fraction, fraction, 0, 0, 0, 0),
                       __builtin_shufflevector(fraction, fraction, 1, 1, 1, 1),
                       __builtin_shufflevector(fraction, fraction, 3, 3, 3, 3));
}

template <class Value>
HWY_INLINE const Value* valuesOf(const FieldData& field) {
    if constexpr (std::is_same_v<Value, float>)
        return field.values.data();
    else
        return field.values16.data();
}

HWY_INLINE Sample sampleOf(const Floats& distanceAndGradient) {
    Sample sample;
    std::memcpy(static_cast<void*>(&sample), &distanceAndGradient, sizeof distanceAndGradient);
    // writes the padding too: a reader of the whole sample does not wait for a single byte
    const std::array<bool, 4> padded{true};
    std::memcpy(static_cast<void*>(&sample.inBand), &padded, sizeof padded);
    return sample;
}

HWY_INLINE glm::dvec3 localOf(const FieldData& field, const glm::vec3& point) {
    return field.toLocal(point);
}
HWY_INLINE glm::dvec3 localOf(const FieldData&, const glm::dvec3& local) {
    return local;
}

/// Samples a cell that is partly outside the band.
/// @param cell  its first voxel
template <class Point>
HWY_NOINLINE Sample sampleBesideBand(const FieldData& field, std::size_t cell, Floats fraction, const Point& point) {
    const auto side = [&](std::size_t v) {
        return Floats{field.valueAt(v), field.valueAt(v + 1), field.valueAt(v + yStep), field.valueAt(v + yStep + 1)};
    };
    const Floats found = interpolate({side(cell), side(cell + xStep), true}, fraction);
    return {.distance = boundBesideBand(field, found[0], localOf(field, point))};
}

/// Samples outside all stored blocks.
template <class Point>
HWY_NOINLINE Sample sampleEmpty(const FieldData& field, std::int32_t block, const Point& point) {
    const bool inside = block == FieldFrame::emptyInside;
    return {.distance = boundInEmptyBlock(field, inside, localOf(field, point))};
}

template <class Point>
HWY_NOINLINE Sample sampleOutside(const FieldData& field, const Point& point) {
    return {.distance = boundOutside(field, localOf(field, point))};
}

/// Prefetches voxels `steps` ahead; there may be none.
template <class Value>
HWY_INLINE void prefetch(const Value* v, int steps) {
    const auto address = reinterpret_cast<std::uintptr_t>(v) + std::size_t(steps) * sizeof(Value);
    __builtin_prefetch(reinterpret_cast<const void*>(address));
}

/// Sequential samples mostly move along a path. Prefetches the rows after those of a cell, in both of its layers, and
/// the same place in a nearby block.
template <class Value>
HWY_INLINE void prefetchWay(const Value* v) {
    constexpr int rows = rowsAhead * yStep, blocks = blocksAhead * FieldFrame::blockFloats;
    for (const int steps : {rows, rows + xStep, blocks, blocks + rows}) prefetch(v, steps);
}

/// @param limited  whether the gradient is computed only where the distance is at most `gradientReach`
/// @param point    glm::vec3 in field coordinates [m], or glm::dvec3 from the directory's first voxel [voxels]
template <class Value, bool limited, class Point>
HWY_INLINE Sample sampleOne(const FieldData& field, const Point& point, float gradientReach) {
    const Place place = placeOf(field, point);
    const auto& [x, y, z] = place.block;
    const auto beyond = [&](int axis) { return place.block[axis] >= std::uint32_t(field.blocks[axis]); };
    if (HWY_UNLIKELY(beyond(0)) || HWY_UNLIKELY(beyond(1)) || HWY_UNLIKELY(beyond(2)))
        return sampleOutside(field, point);
    const std::int32_t block = field.directory[x * field.lanes.xBlocks + y * std::uint32_t(field.blocks.z) + z];
    if (HWY_UNLIKELY(block < 0)) return sampleEmpty(field, block, point);

    const auto inBlock = [&](int axis) { return place.inBlock[axis] >> fractionBits; };
    const std::size_t voxel =
        std::size_t(block) * FieldFrame::blockFloats + ((inBlock(0) * yStep + inBlock(1)) * yStep + inBlock(2));
    const Value* const v = valuesOf<Value>(field) + voxel;
    const Cell<Floats> cell = loadCell(v);
    prefetchWay(v);
    const Floats found = interpolate(cell, place.fraction) * field.lanes.scales;
    if (HWY_UNLIKELY(cell.beyond || std::isnan(found[0]))) return sampleBesideBand(field, voxel, place.fraction, point);
    if (limited && HWY_UNLIKELY(!(found[0] <= gradientReach))) return sampleOf(Floats{found[0]});
    return sampleOf(found);
}

template <class Value, class Point>
Sample sampleWithin(const FieldData& field, const Point& point, float gradientReach) noexcept {
    return sampleOne<Value, true>(field, point, gradientReach);
}

template <class Value>
Sample samplePoint(const FieldData& field, const glm::vec3& point) noexcept {
    return sampleOne<Value, false>(field, point, infinity);
}

/// Count of points whose voxels are being prefetched: enough to hide the memory latency, and few enough for the
/// outstanding misses of a core.
constexpr std::size_t ahead = 32;
constexpr std::size_t atOnce = 4;  // count of points that are located together
static_assert(ahead % atOnce == 0);

/// A ring buffer of located points: the first voxel of the cell, and the fractions.
template <class Value>
struct Cells {
    std::array<const Value*, ahead> first;
    std::array<float, ahead> x, y, z;
};

/// For places in no stored block.
template <class Value>
constexpr auto cellBeyondBand = [] {
    std::array<Value, xStep + yStep + 2> values{};
    values.fill(std::is_same_v<Value, float> ? std::numeric_limits<Value>::quiet_NaN() : FieldLayout::beyondOutside);
    return values;
}();

/// Four places along one axis.
struct FourWords {
    Words block, inBlock;
    Words within;  ///< highest bit: the place is in the directory's box
};

HWY_INLINE FourWords wordsOf(const FieldData& field, Floats coordinate, double offset, int blocks) {
    using EightWords [[gnu::vector_size(32)]] = std::uint32_t;
    const FourDoubles fixed = asDoubles(coordinate) * field.perMetre + offset;
    const EightWords words = reinterpret_cast<EightWords>(fixed);
    const Words block = __builtin_shufflevector(words, words, 1, 3, 5, 7) - firstBlock;
    return {block, __builtin_shufflevector(words, words, 0, 2, 4, 6), ~block & (block - std::uint32_t(blocks))};
}

/// Finds the cells of four points, and prefetches their voxels.
template <class Value>
HWY_INLINE void locateFour(const FieldData& field, const glm::vec3* points, Cells<Value>& cells, std::size_t slot) {
    const Floats a = load<Floats>(&points[0].x), b = load<Floats>(&points[1].y), c = load<Floats>(&points[2].z);
    const Floats px = __builtin_shufflevector(__builtin_shufflevector(a, b, 0, 3, 6, 6), c, 0, 1, 2, 5),
                 py = __builtin_shufflevector(__builtin_shufflevector(a, b, 1, 4, 7, 7), c, 0, 1, 2, 6),
                 pz = __builtin_shufflevector(__builtin_shufflevector(a, b, 2, 5, 5, 5), c, 0, 1, 4, 7);
    const FieldData::Lanes& lanes = field.lanes;
    const FourWords x = wordsOf(field, px, lanes.offsetXy[0], field.blocks.x),
                    y = wordsOf(field, py, lanes.offsetXy[1], field.blocks.y),
                    z = wordsOf(field, pz, lanes.offsetYz[1], field.blocks.z);
    const Floats fractions[] = {fractionOf(field, x.inBlock), fractionOf(field, y.inBlock),
                                fractionOf(field, z.inBlock)};
    std::memcpy(&cells.x[slot], &fractions[0], sizeof(Floats));
    std::memcpy(&cells.y[slot], &fractions[1], sizeof(Floats));
    std::memcpy(&cells.z[slot], &fractions[2], sizeof(Floats));

    const Ints beside = ~(reinterpret_cast<Ints>(x.within & y.within & z.within) >> 31);  // all bits or none
    const Words entry =
        ((x.block * std::uint32_t(field.blocks.y) + y.block) * std::uint32_t(field.blocks.z) + z.block) &
        ~reinterpret_cast<Words>(beside);
    const Words voxel =
        ((x.inBlock >> fractionBits) * std::uint32_t(yStep) + (y.inBlock >> fractionBits)) * std::uint32_t(yStep) +
        (z.inBlock >> fractionBits);
    for (int i = 0; i < int(atOnce); ++i) {
        const std::int32_t block = field.directory[entry[i]] | beside[i];
        const Value* const v = block < 0
                                   ? cellBeyondBand<Value>.data()
                                   : valuesOf<Value>(field) + std::size_t(block) * FieldFrame::blockFloats + voxel[i];
        for (const int step : {0, yStep + 1, xStep, xStep + yStep + 1}) __builtin_prefetch(v + step);
        cells.first[slot + std::size_t(i)] = v;
    }
}

/// Two consecutive floats, each in four lanes.
HWY_INLINE TwoFloats eachInFour(const float* two) {
    const double pair = load<double>(two);
    const TwoFloats pairs = reinterpret_cast<TwoFloats>(FourDoubles{pair, pair, pair, pair});
    return __builtin_shufflevector(pairs, pairs, 0, 0, 0, 0, 5, 5, 5, 5);
}

/// Samples two points if both are in the band.
template <class Value>
HWY_INLINE bool sampleTwo(const FieldData& field, const Cells<Value>& cells, std::size_t slot, Sample* samples) {
    const auto two = loadCells(cells.first[slot], cells.first[slot + 1]);
    const Floats& scales = field.lanes.scales;
    const TwoFloats found =
        interpolate(two, eachInFour(&cells.x[slot]), eachInFour(&cells.y[slot]), eachInFour(&cells.z[slot])) *
        both(scales, scales);
    const Floats first = __builtin_shufflevector(found, found, 0, 1, 2, 3),
                 second = __builtin_shufflevector(found, found, 4, 5, 6, 7);
    if (HWY_UNLIKELY(two.beyond || std::isnan(first[0] + second[0]))) return false;
    samples[0] = sampleOf(first);
    samples[1] = sampleOf(second);
    return true;
}

template <class Value>
HWY_NOINLINE void sampleEach(const FieldData& field, std::span<const glm::vec3> points, Sample* samples) {
    for (std::size_t i = 0; i < points.size(); ++i) samples[i] = samplePoint<Value>(field, points[i]);
}

template <class Value>
void sampleMany(const FieldData& field, std::span<const glm::vec3> points, Sample* samples) noexcept {
    Cells<Value> cells;
    const std::size_t inFours = points.size() / atOnce * atOnce;
    for (std::size_t i = 0; i < std::min(inFours, ahead); i += atOnce) locateFour(field, &points[i], cells, i);
    for (std::size_t i = 0; i < inFours; i += atOnce) {
        const std::size_t slot = i % ahead;
        for (std::size_t k = 0; k < atOnce; k += 2)
            if (HWY_UNLIKELY(!sampleTwo(field, cells, slot + k, samples + i + k)))
                sampleEach<Value>(field, points.subspan(i + k, 2), samples + i + k);
        if (i + ahead < inFours) locateFour(field, &points[i + ahead], cells, slot);
    }
    sampleEach<Value>(field, points.subspan(inFours), samples + inFours);
}

template <class Value>
constexpr SampleKernels kernelsOf{sampleWithin<Value, glm::dvec3>, samplePoint<Value>, sampleWithin<Value, glm::vec3>,
                                  sampleMany<Value>};

const SampleKernels& kernels(Storage storage) {
    return storage == Storage::float32 ? kernelsOf<float> : kernelsOf<std::int16_t>;
}

}  // namespace
}  // namespace bilayer::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bilayer {

using namespace detail;

HWY_EXPORT(kernels);

const SampleKernels& detail::sampleKernels(Storage storage) {
    return HWY_DYNAMIC_DISPATCH(kernels)(storage);
}

Sample Field::sampleWithin(const glm::vec3& point, float reach) const noexcept {
    return data_->kernels.sampleWithin(*data_, point, reach);
}

float Field::distance(const glm::vec3& point) const noexcept {
    return sampleWithin(point, -infinity).distance;
}

void Field::sample(std::span<const glm::vec3> points, std::span<Sample> samples) const {
    requireSameLength(points.size(), samples.size(), "samples");
    data_->kernels.sampleMany(*data_, points, samples.data());
}

}  // namespace bilayer
#endif
