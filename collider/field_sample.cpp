// Samples, single and in batches. cl/field.cl samples in the same way, operation by operation.
//
// A place is a fixed-point number along each axis: its upper bits are the voxel, its lower bits the way to the next.
// The eight voxels around it are interpolated in two vectors of four: along x first, then y, then z, and the gradient
// falls out on the way. Highway compiles the part between HWY_BEFORE_NAMESPACE and HWY_AFTER_NAMESPACE once for each
// instruction set; all of them give the same bytes.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "collider/field_sample.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <array>
#include <bit>
#include <cstring>
#include <glm/geometric.hpp>

#include "collider/field.h"
#include "collider/field_data.h"

#ifndef BILAYER_COLLIDER_FIELD_SAMPLE_ONCE
#define BILAYER_COLLIDER_FIELD_SAMPLE_ONCE

namespace bilayer {
namespace {

constexpr float infinity = std::numeric_limits<float>::infinity();
constexpr float cellDiagonal = FieldData::cellDiagonal;

// Samples are stored as four floats in a row and a bool.
static_assert(offsetof(Sample, distance) == 0 && offsetof(Sample, gradient) == sizeof(float));

// What the interpolant of values that go no faster than the distance itself may be off by: the mean way to the eight
// voxels, by their weights, which is at most the root of its mean square [voxels].
float interpolationError(const glm::vec3& fraction) {
    const glm::vec3 spread = fraction * (1.f - fraction);
    return std::sqrt(spread.x + spread.y + spread.z);
}

// Who comes from outside the directory's box has that way to go, and is then no more than a cell's diagonal from a
// voxel beyond the band.
float boundOutside(const FieldData& field, const glm::dvec3& local) {
    const double way = glm::distance(local, glm::clamp(local, glm::dvec3(0), field.extent()));
    if (!std::isfinite(way)) return infinity;
    return std::max(0.f, float(way - double(cellDiagonal)) * field.voxelSize + field.exteriorWidth);
}

// The nearest voxel of the block itself is beyond the band. It is half a cell's diagonal away, or a whole one where the
// cell ends in another block.
float boundInEmptyBlock(const FieldData& field, bool inside, const glm::dvec3& local) {
    const glm::dvec3 rest = local - double(FieldFrame::side) * glm::floor(local / double(FieldFrame::side));
    const bool ownCell = std::max({rest.x, rest.y, rest.z}) <= double(FieldFrame::side - 1);
    const float width = inside ? field.interiorWidth : field.exteriorWidth;
    const float besideBand = width - (ownCell ? 0.5f : 1.f) * cellDiagonal * field.voxelSize;
    const float bound = std::max({0.f, besideBand, field.voxelSize * field.clearanceAt(local)});
    return inside ? -bound : bound;
}

// One of the cell's voxels is beyond the band.
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

// vectors wider than those of the plain instruction set are passed between functions that are all inlined
#pragma GCC diagnostic ignored "-Wpsabi"

HWY_BEFORE_NAMESPACE();
namespace bilayer::HWY_NAMESPACE {

using Pairs [[gnu::vector_size(16)]] = double;
using TwoFloats [[gnu::vector_size(32)]] = float;  // of two places
using TwoInts [[gnu::vector_size(32)]] = std::int32_t;

constexpr int fractionBits = FieldData::fractionBits, voxelBits = FieldData::voxelBits;

/// Of a place's three axes: where its block is in the directory and where its voxel is in the block.
struct Address {
    std::uint32_t entry, inBlock;
    bool within;  ///< the directory's box
};

/// Where a cell is, and where a place lies in it.
struct Place {
    Address address;
    Floats fraction;  ///< x, y, y, z
};

template <class Word, class Element>
HWY_INLINE Word load(const Element* from) {
    Word word;
    std::memcpy(&word, from, sizeof word);
    return word;
}

/// From [x, y, y, z], which two loads of eight bytes give.
HWY_INLINE void loadPoint(const glm::vec3& point, Doubles& to) {
    const Pairs halves{load<double>(&point.x), load<double>(&point.y)};
    const Floats at = reinterpret_cast<Floats>(halves);
#if HWY_ARCH_X86 && HWY_TARGET <= HWY_AVX2 && HWY_COMPILER_GCC_ACTUAL
    // one instruction, where GCC 12 makes six of the conversion below
    to = __builtin_ia32_cvtps2pd256(at);
#else
    to = __builtin_convertvector(at, Doubles);
#endif
}

HWY_INLINE bool anyNegative(const Bits& v) {
#if HWY_ARCH_X86 && HWY_TARGET <= HWY_AVX2
    return __builtin_ia32_movmskpd256(reinterpret_cast<Doubles>(v)) != 0;
#else
    return (v[0] | v[1] | v[3]) >> 63;
#endif
}

/// Rounds to 2^-23 voxels. What is negative, huge or no number is not within.
/// @param local  [x, y, y, z] from the directory's first voxel [voxels]
HWY_INLINE Place placeOf(const FieldData& field, const Doubles& local) {
    const FieldData::Lanes& lanes = field.lanes;
    const Bits fixed = reinterpret_cast<Bits>(local + lanes.fixedPoint) - lanes.zeroPlace;
    const bool outside = anyNegative(fixed | (lanes.lastPlace - fixed));
    const Ints voxel = __builtin_convertvector(fixed >> fractionBits, Ints);
    const Ints entry = (voxel >> voxelBits) * lanes.blockStrides;
    const Ints inBlock = (voxel & lanes.inBlock) * lanes.voxelStrides;
    // sums over the axes, both at once
    const Ints half =
        __builtin_shufflevector(entry, inBlock, 0, 4, 1, 5) + __builtin_shufflevector(entry, inBlock, 2, 6, 3, 7);
    const Ints sum = half + __builtin_shufflevector(half, half, 2, 3, 0, 1);
    const Ints fraction = (__builtin_convertvector(fixed, Ints) & lanes.fraction) | lanes.one;
    return {{std::uint32_t(sum[0]), std::uint32_t(sum[1]), !outside},
            reinterpret_cast<Floats>(fraction) - reinterpret_cast<Floats>(lanes.one)};
}

/// The same of a point [m].
HWY_INLINE Place placeOf(const FieldData& field, const glm::vec3& point) {
    Doubles at;
    loadPoint(point, at);
    return placeOf(field, (at - field.lanes.origin) * field.lanes.perMetre);
}

HWY_INLINE Place placeOf(const FieldData& field, const glm::dvec3& local) {
    return placeOf(field, Doubles{local.x, local.y, local.y, local.z});
}

/// The voxels around a place at its lower and at its upper x: (y, z), (y, z + 1), (y + 1, z), (y + 1, z + 1). Of two
/// places, one behind the other.
template <class Vector>
struct Cell {
    Vector low, high;
    bool inBand;
};

constexpr int xStep = FieldFrame::stride * FieldFrame::stride, yStep = FieldFrame::stride;

HWY_INLINE bool all(Ints mask) {
#if HWY_ARCH_X86
    return __builtin_ia32_movmskps(reinterpret_cast<Floats>(mask)) == 15;
#else
    return mask[0] & mask[1] & mask[2] & mask[3];
#endif
}

HWY_INLINE bool all(TwoInts mask) {
#if HWY_ARCH_X86 && HWY_TARGET <= HWY_AVX2
    return __builtin_ia32_movmskps256(reinterpret_cast<TwoFloats>(mask)) == 255;
#else
    return all(__builtin_shufflevector(mask, mask, 0, 1, 2, 3) & __builtin_shufflevector(mask, mask, 4, 5, 6, 7));
#endif
}

// Of two vectors, four lanes at a time: their lower or upper halves, their even or odd lanes.
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
// The first three lanes of one, and the first of the other.
HWY_INLINE Floats withFourth(Floats a, Floats b) {
    return __builtin_shufflevector(a, b, 0, 1, 2, 4);
}
HWY_INLINE TwoFloats withFourth(TwoFloats a, TwoFloats b) {
    return __builtin_shufflevector(a, b, 0, 1, 2, 8, 4, 5, 6, 12);
}
HWY_INLINE TwoFloats both(Floats a, Floats b) {
    return __builtin_shufflevector(a, b, 0, 1, 2, 3, 4, 5, 6, 7);
}
HWY_INLINE TwoInts both(Ints a, Ints b) {
    return __builtin_shufflevector(a, b, 0, 1, 2, 3, 4, 5, 6, 7);
}
HWY_INLINE TwoFloats twice(Floats a) {
    return both(a, a);
}

/// Two neighbours along z, and two beside them.
HWY_INLINE Floats loadPairs(const float* v) {
    const Pairs pairs{load<double>(v), load<double>(v + yStep)};
    return reinterpret_cast<Floats>(pairs);
}

HWY_INLINE Ints loadPairs(const std::int16_t* v) {
    using PairsOfSteps [[gnu::vector_size(8)]] = std::int32_t;
    using Steps [[gnu::vector_size(8)]] = std::int16_t;
    const PairsOfSteps pairs{load<std::int32_t>(v), load<std::int32_t>(v + yStep)};
    return __builtin_convertvector(reinterpret_cast<Steps>(pairs), Ints);
}

template <class Vector>
HWY_INLINE Cell<Vector> cellOf(Vector low, Vector high, Vector least, Vector most) {
    return {low, high, all((low > least) & (low < most) & (high > least) & (high < most))};
}

/// Values in steps; where some are beyond the band, they are as far as the band is wide.
template <class Vector, class Steps>
HWY_INLINE Cell<Vector> decoded(Steps low, Steps high, float step, Vector least, Vector most) {
    constexpr std::int32_t beyond = FieldLayout::beyondBand;
    const bool inBand = all((low > -beyond) & (low < beyond) & (high > -beyond) & (high < beyond));
    const Vector lowValues = __builtin_convertvector(low, Vector) * step,
                 highValues = __builtin_convertvector(high, Vector) * step;
    if (HWY_LIKELY(inBand)) return {lowValues, highValues, true};
    const auto clamped = [&](Vector values) {
        values = values < least ? least : values;
        return values > most ? most : values;
    };
    return {clamped(lowValues), clamped(highValues), false};
}

HWY_INLINE Cell<Floats> loadCell(const FieldData& field, const float* v) {
    return cellOf(loadPairs(v), loadPairs(v + xStep), field.lanes.least, field.lanes.most);
}

HWY_INLINE Cell<Floats> loadCell(const FieldData& field, const std::int16_t* v) {
    return decoded(loadPairs(v), loadPairs(v + xStep), field.step, field.lanes.least, field.lanes.most);
}

HWY_INLINE Cell<TwoFloats> loadCells(const FieldData& field, const float* v, const float* w) {
    return cellOf(both(loadPairs(v), loadPairs(w)), both(loadPairs(v + xStep), loadPairs(w + xStep)),
                  twice(field.lanes.least), twice(field.lanes.most));
}

HWY_INLINE Cell<TwoFloats> loadCells(const FieldData& field, const std::int16_t* v, const std::int16_t* w) {
    return decoded(both(loadPairs(v), loadPairs(w)), both(loadPairs(v + xStep), loadPairs(w + xStep)), field.step,
                   twice(field.lanes.least), twice(field.lanes.most));
}

/// The distance [m] and its gradient [m a voxel], by the fractions of the place, each in all lanes.
template <class Vector>
HWY_INLINE Vector interpolate(const Cell<Vector>& cell, Vector x, Vector y, Vector z) {
    const Vector dx = cell.high - cell.low, at = cell.low + x * dx;
    // values at z and z + 1, then how they change along x
    const Vector y0 = lowerHalves(at, dx), y1 = upperHalves(at, dx);
    const Vector dy = y1 - y0, between = y0 + y * dy;
    // value, along x, along y
    const Vector z0 = evenLanes(between, dy), z1 = oddLanes(between, dy);
    const Vector dz = z1 - z0, found = z0 + z * dz;
    return withFourth(found, dz);
}

HWY_INLINE Floats interpolate(const Cell<Floats>& cell, Floats fraction) {
    return interpolate(cell, __builtin_shufflevector(fraction, fraction, 0, 0, 0, 0),
                       __builtin_shufflevector(fraction, fraction, 1, 1, 1, 1),
                       __builtin_shufflevector(fraction, fraction, 3, 3, 3, 3));
}

HWY_INLINE TwoFloats interpolate(const Cell<TwoFloats>& cells, TwoFloats fractions) {
    return interpolate(cells, __builtin_shufflevector(fractions, fractions, 0, 0, 0, 0, 4, 4, 4, 4),
                       __builtin_shufflevector(fractions, fractions, 1, 1, 1, 1, 5, 5, 5, 5),
                       __builtin_shufflevector(fractions, fractions, 3, 3, 3, 3, 7, 7, 7, 7));
}

template <class Value>
HWY_INLINE const Value* valuesOf(const FieldData& field) {
    if constexpr (std::is_same_v<Value, float>)
        return field.values.data();
    else
        return field.values16.data();
}

/// The first voxel of a cell in a stored block.
template <class Value>
HWY_INLINE const Value* cellOf(const FieldData& field, std::int32_t block, const Place& place) {
    return valuesOf<Value>(field) + std::size_t(block) * FieldFrame::blockFloats + place.address.inBlock;
}

HWY_INLINE Sample sampleOf(const Floats& distanceAndGradient, bool inBand) {
    Sample sample;
    std::memcpy(static_cast<void*>(&sample), &distanceAndGradient, sizeof distanceAndGradient);
    // with the padding behind it: who reads all of a sample need not wait for a single byte
    const std::array<bool, 4> padded{inBand};
    std::memcpy(static_cast<void*>(&sample.inBand), &padded, sizeof padded);
    return sample;
}

HWY_INLINE glm::dvec3 localOf(const FieldData& field, const glm::vec3& point) {
    return field.toLocal(point);
}
HWY_INLINE glm::dvec3 localOf(const FieldData&, const glm::dvec3& local) {
    return local;
}

/// Samples a cell that is partly beyond the band.
template <class Point>
HWY_NOINLINE Sample sampleBesideBand(const FieldData& field, float distance, const Point& point) {
    return {.distance = boundBesideBand(field, distance, localOf(field, point))};
}

/// Samples beside all stored blocks.
template <class Point>
HWY_NOINLINE Sample sampleEmpty(const FieldData& field, std::int32_t block, bool within, const Point& point) {
    const glm::dvec3 local = localOf(field, point);
    return {.distance = within ? boundInEmptyBlock(field, block == FieldFrame::emptyInside, local)
                               : boundOutside(field, local)};
}

/// Samples a cell of a stored block.
template <class Value, class Point>
HWY_INLINE Sample sampleCell(const FieldData& field, std::int32_t block, const Place& place, const Point& point,
                             float gradientReach) {
    const Cell<Floats> cell = loadCell(field, cellOf<Value>(field, block, place));
    const Floats found = interpolate(cell, place.fraction);
    if (HWY_UNLIKELY(!cell.inBand)) return sampleBesideBand(field, found[0], point);
    if (HWY_UNLIKELY(!(found[0] <= gradientReach))) return sampleOf(Floats{found[0]}, true);
    return sampleOf(found * field.lanes.scales, true);
}

HWY_INLINE std::int32_t blockAt(const FieldData& field, const Address& address) {
    return HWY_LIKELY(address.within) ? field.directory[address.entry] : FieldFrame::emptyOutside;
}

template <class Value, class Point>
HWY_INLINE Sample samplePlace(const FieldData& field, std::int32_t block, const Place& place, const Point& point,
                              float gradientReach) {
    if (HWY_UNLIKELY(block < 0)) return sampleEmpty(field, block, place.address.within, point);
    return sampleCell<Value>(field, block, place, point, gradientReach);
}

/// Samples two places in stored blocks, if both are in the band.
template <class Value>
HWY_INLINE bool sampleTwo(const FieldData& field, const std::int32_t* blocks, const Place* places, Sample* samples) {
    const auto cells =
        loadCells(field, cellOf<Value>(field, blocks[0], places[0]), cellOf<Value>(field, blocks[1], places[1]));
    if (HWY_UNLIKELY(!cells.inBand)) return false;
    const TwoFloats found =
        interpolate(cells, both(places[0].fraction, places[1].fraction)) * twice(field.lanes.scales);
    samples[0] = sampleOf(__builtin_shufflevector(found, found, 0, 1, 2, 3), true);
    samples[1] = sampleOf(__builtin_shufflevector(found, found, 4, 5, 6, 7), true);
    return true;
}

/// @param point  glm::vec3 in the field's own coordinates [m], or glm::dvec3 from the directory's first voxel [voxels]
template <class Value, class Point>
Sample sampleAt(const FieldData& field, const Point& point, float gradientReach) {
    const Place place = placeOf(field, point);
    return samplePlace<Value>(field, blockAt(field, place.address), place, point, gradientReach);
}

/// Points of a batch that are under way together: enough to hide the memory's latency, few enough to stay in the
/// nearest cache.
constexpr std::size_t together = 32;

/// Samples up to that many points: the first pass asks for their entries of the directory, the second for their voxels.
template <class Value>
HWY_INLINE void sampleTogether(const FieldData& field, std::span<const glm::vec3> points, Sample* samples) {
    Place places[together];
    std::int32_t blocks[together];
    for (std::size_t i = 0; i < points.size(); ++i) {
        places[i] = placeOf(field, points[i]);
        __builtin_prefetch(field.directory.data() + (places[i].address.within ? places[i].address.entry : 0));
    }
    for (std::size_t i = 0; i < points.size(); ++i) {
        blocks[i] = blockAt(field, places[i].address);
        const Value* const v = cellOf<Value>(field, std::max(blocks[i], 0), places[i]);
        __builtin_prefetch(v);
        __builtin_prefetch(v + yStep + 1);
        __builtin_prefetch(v + xStep);
        __builtin_prefetch(v + xStep + yStep + 1);
    }
    std::size_t i = 0;
    for (; i + 1 < points.size(); i += 2)
        if (HWY_UNLIKELY((blocks[i] | blocks[i + 1]) < 0 ||
                         !sampleTwo<Value>(field, blocks + i, places + i, samples + i)))
            for (std::size_t k = i; k < i + 2; ++k)
                samples[k] = samplePlace<Value>(field, blocks[k], places[k], points[k], infinity);
    if (i < points.size()) samples[i] = samplePlace<Value>(field, blocks[i], places[i], points[i], infinity);
}

template <class Value>
void sampleMany(const FieldData& field, std::span<const glm::vec3> points, Sample* samples) {
    for (std::size_t i = 0; i < points.size(); i += together)
        sampleTogether<Value>(field, points.subspan(i, std::min(together, points.size() - i)), samples + i);
}

template <class Value>
constexpr SampleKernels kernelsOf{sampleAt<Value, glm::dvec3>, sampleAt<Value, glm::vec3>, sampleMany<Value>};

const SampleKernels& kernels(Storage storage) {
    return storage == Storage::float32 ? kernelsOf<float> : kernelsOf<std::int16_t>;
}

}  // namespace bilayer::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bilayer {

HWY_EXPORT(kernels);

const SampleKernels& sampleKernels(Storage storage) {
    return HWY_DYNAMIC_DISPATCH(kernels)(storage);
}

Sample Field::sample(const glm::vec3& point) const noexcept {
    return data_->kernels.samplePoint(*data_, point, infinity);
}

Sample Field::sampleWithin(const glm::vec3& point, float reach) const noexcept {
    return data_->kernels.samplePoint(*data_, point, reach);
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
