// SPDX-License-Identifier: Apache-2.0
// Field sampling, single and in batches. cl/kernels/field.cl samples in the same way, operation by operation. Voxels
// outside the band are NaN, which propagates to the result. Highway compiles the part between HWY_BEFORE_NAMESPACE and
// HWY_AFTER_NAMESPACE once for each instruction set. All of them give the same bytes.
// Tested by tests/collider/field.cpp through Field::sample().
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "collider/field/samples/field_sample.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <array>
#include <cstring>
#include <limits>

#include <bilayer/collider/field.h>
#include "collider/field/layout/batch.h"
#include "collider/field/samples/distance_bounds.h"
#include "collider/field/samples/field_data.h"
#include "collider/field/samples/sample_cell.h"
#include "collider/field/samples/sample_place.h"
#include "collider/field/samples/sample_vectors.h"
#include "sdf/base/access.h"

HWY_BEFORE_NAMESPACE();
namespace bilayer::detail::HWY_NAMESPACE {

namespace {
constexpr float infinity = std::numeric_limits<float>::infinity();
constexpr int fractionBits = FieldData::fractionBits;
// Prefetch distances of single samples: two cache lines ahead, and the block after the next.
constexpr int rowsAhead = 4, blocksAhead = 2;

// Samples are stored as four consecutive floats and a bool.
static_assert(offsetof(Sample, distance) == 0 && offsetof(Sample, gradient) == sizeof(float));

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
HWY_INLINE glm::dvec3 localOf(const FieldData&, const TilePoint& point) {
    return point.local;
}
HWY_INLINE FixedNumbers numbersOf(const FieldData& field, const TilePoint& point) {
    return numbersOf(field, point.point);
}

/// Samples a cell that is partly outside the band.
/// @param cell  its first voxel
template <class Point>
HWY_NOINLINE Sample sampleNextToBand(const FieldData& field, std::size_t cell, Floats fraction, const Point& point) {
    const auto side = [&](std::size_t v) {
        return Floats{field.valueAt(v), field.valueAt(v + 1), field.valueAt(v + yStep), field.valueAt(v + yStep + 1)};
    };
    const Floats found = interpolate({side(cell), side(cell + xStep), true}, fraction);
    return {.distance = boundNextToBand(field, found[0], localOf(field, point))};
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
HWY_INLINE void prefetchAlong(const Value* v) {
    constexpr int rows = rowsAhead * yStep, blocks = blocksAhead * FieldFrame::blockFloats;
    for (const int steps : {rows, rows + xStep, blocks, blocks + rows}) prefetch(v, steps);
}

/// The block of a place in the directory, or a negative number: none is stored there.
HWY_INLINE std::int32_t blockAt(const FieldData& field, std::uint32_t x, std::uint32_t y, std::uint32_t z) {
    return field.directory[x * field.lanes.xBlocks + y * std::uint32_t(field.blocks.z) + z];
}

/// Whether a block is outside the directory, along one axis or more.
HWY_INLINE bool isBeyond(const FieldData& field, std::uint32_t x, std::uint32_t y, std::uint32_t z) {
    return HWY_UNLIKELY(x >= std::uint32_t(field.blocks.x)) || HWY_UNLIKELY(y >= std::uint32_t(field.blocks.y)) ||
           HWY_UNLIKELY(z >= std::uint32_t(field.blocks.z));
}

/// The index of a cell's first voxel in its block.
HWY_INLINE std::size_t voxelOf(const FixedPlace& place) {
    const auto inBlock = [&](int axis) { return place.inBlock[axis] >> fractionBits; };
    return (inBlock(0) * yStep + inBlock(1)) * yStep + inBlock(2);
}

/// @param limited  whether the gradient is computed only where the distance is at most `gradientReach`
/// @param point    glm::vec3 in field coordinates [m], glm::dvec3 from the directory's first voxel [voxels], or both
template <class Value, bool limited, class Point>
HWY_INLINE Sample sampleOne(const FieldData& field, const Point& point, float gradientReach) {
    const FixedPlace place = placeOf(field, numbersOf(field, point));
    const auto& [x, y, z] = place.block;
    if (isBeyond(field, x, y, z)) return sampleOutside(field, point);
    const std::int32_t block = blockAt(field, x, y, z);
    if (HWY_UNLIKELY(block < 0)) return sampleEmpty(field, block, point);

    const std::size_t voxel = std::size_t(block) * FieldFrame::blockFloats + voxelOf(place);
    const Value* const v = valuesOf<Value>(field) + voxel;
    const CellLanes<Floats> cell = loadCell(v);
    prefetchAlong(v);
    const Floats found = interpolate(cell, place.fraction) * field.lanes.scales;
    if (HWY_UNLIKELY(cell.beyond || std::isnan(found[0]))) return sampleNextToBand(field, voxel, place.fraction, point);
    if (limited && HWY_UNLIKELY(!(found[0] <= gradientReach))) return sampleOf(Floats{found[0]});
    return sampleOf(found);
}

/// Finds the block of a place. If it is stored, it becomes the last block, and its first voxel is returned.
/// @param upper  of FixedNumbers
template <class Value>
HWY_INLINE const Value* enterBlock(const FieldData& field, LastBlock& last, Words upper) {
    const Words place = upper - firstBlock;
    const std::uint32_t x = place[0], y = place[1], z = place[3];
    if (isBeyond(field, x, y, z)) return nullptr;
    const std::int32_t block = blockAt(field, x, y, z);
    if (HWY_UNLIKELY(block < 0)) return nullptr;
    const Value* const first = valuesOf<Value>(field) + std::size_t(block) * FieldFrame::blockFloats;
    std::memcpy(last.place.data(), &upper, sizeof upper);
    last.first = first;
    return first;
}

/// The distance and its gradient at a point in the band, elsewhere NaN.
template <class Value>
Floats sampleInBand(const FieldData& field, LastBlock& last, const glm::vec3& point) noexcept {
    constexpr Floats none{std::numeric_limits<float>::quiet_NaN()};
    const FixedNumbers numbers = numbersOf(field, point);
    const FixedPlace place = placeOf(field, numbers);
    const std::size_t voxel = voxelOf(place);
    auto first = static_cast<const Value*>(last.first);
    if (HWY_LIKELY(equal(numbers.upper(), load<Words>(last.place.data())))) {
        prefetchAlong(first + voxel);
    } else {
        // perhaps random points, which need nothing nearby
        first = enterBlock<Value>(field, last, numbers.upper());
        if (HWY_UNLIKELY(!first)) return none;
    }
    const CellLanes<Floats> cell = loadCell(first + voxel);
    const Floats found = interpolate(cell, place.fraction) * field.lanes.scales;
    return HWY_UNLIKELY(cell.beyond) ? none : found;
}

template <class Value, class Point>
Sample sampleWithin(const FieldData& field, const Point& point, float gradientReach) noexcept {
    return sampleOne<Value, true>(field, point, gradientReach);
}

template <class Value, class Point>
Sample samplePoint(const FieldData& field, const Point& point) noexcept {
    return sampleOne<Value, false>(field, point, infinity);
}

/// Count of points whose voxels are being prefetched: enough to hide the memory latency, and few enough for the
/// outstanding misses of a core.
constexpr std::size_t ahead = 32;
constexpr std::size_t atOnce = 4;  // count of points that are located together
static_assert(ahead % atOnce == 0);

/// A ring buffer of located points: the first voxel of the cell, and the fractions.
template <class Value>
struct LocatedCells {
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

/// Finds the cells of four points, and prefetches their voxels.
template <class Value>
HWY_INLINE void locateFour(const FieldData& field, const glm::vec3* points, LocatedCells<Value>& cells,
                           std::size_t slot) {
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

    const Ints outside = ~(reinterpret_cast<Ints>(x.within & y.within & z.within) >> 31);  // all bits or none
    const Words entry =
        ((x.block * std::uint32_t(field.blocks.y) + y.block) * std::uint32_t(field.blocks.z) + z.block) &
        ~reinterpret_cast<Words>(outside);
    const Words voxel =
        ((x.inBlock >> fractionBits) * std::uint32_t(yStep) + (y.inBlock >> fractionBits)) * std::uint32_t(yStep) +
        (z.inBlock >> fractionBits);
    for (int i = 0; i < int(atOnce); ++i) {
        const std::int32_t block = field.directory[entry[i]] | outside[i];
        const Value* const v = block < 0
                                   ? cellBeyondBand<Value>.data()
                                   : valuesOf<Value>(field) + std::size_t(block) * FieldFrame::blockFloats + voxel[i];
        for (const int step : {0, yStep + 1, xStep, xStep + yStep + 1}) __builtin_prefetch(v + step);
        cells.first[slot + std::size_t(i)] = v;
    }
}

/// Two consecutive floats, each in four lanes.
HWY_INLINE EightFloats eachInFour(const float* two) {
    const double pair = load<double>(two);
    const EightFloats pairs = reinterpret_cast<EightFloats>(FourDoubles{pair, pair, pair, pair});
    return __builtin_shufflevector(pairs, pairs, 0, 0, 0, 0, 5, 5, 5, 5);
}

/// Samples two points if both are in the band.
template <class Value>
HWY_INLINE bool sampleTwo(const FieldData& field, const LocatedCells<Value>& cells, std::size_t slot, Sample* samples) {
    const auto two = loadCells(cells.first[slot], cells.first[slot + 1]);
    const Floats& scales = field.lanes.scales;
    const EightFloats found =
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
    LocatedCells<Value> cells;
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
constexpr SampleKernels kernelsOf{
    sampleWithin<Value, glm::dvec3>, samplePoint<Value, glm::vec3>, sampleWithin<Value, glm::vec3>,
    samplePoint<Value, TilePoint>,   sampleInBand<Value>,           sampleMany<Value>};

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

FieldSampler::FieldSampler(const Field& field) noexcept
    : data_(&dataOf(field)), sampleInBand_(data_->kernels.sampleInBand) {}

Sample FieldSampler::sampleAnywhere(const glm::vec3& point) const noexcept {
    return data_->kernels.samplePoint(*data_, point);
}

float Field::distance(const glm::vec3& point) const noexcept {
    return sampleWithin(point, -std::numeric_limits<float>::infinity()).distance;
}

void Field::sample(std::span<const glm::vec3> points, std::span<Sample> samples) const {
    requireSameLength(points.size(), "points", samples.size(), "samples");
    data_->kernels.sampleMany(*data_, points, samples.data());
}

}  // namespace bilayer
#endif
