// SPDX-License-Identifier: Apache-2.0
// The eight voxels around a place, and their trilinear interpolation in two vectors of four: along x first, then y,
// then z. The gradient is a by-product. Highway includes this file once for each instruction set: only between
// HWY_BEFORE_NAMESPACE's headers and its own, after hwy/highway.h.
// Tested by tests/collider/field.cpp through Field::sample().
#if defined(BILAYER_COLLIDER_SAMPLE_CELL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef BILAYER_COLLIDER_SAMPLE_CELL_H
#undef BILAYER_COLLIDER_SAMPLE_CELL_H
#else
#define BILAYER_COLLIDER_SAMPLE_CELL_H
#endif

#include <hwy/highway.h>

#include <cstdint>
#include <type_traits>

#include "collider/field/samples/field_data.h"
#include "collider/field/samples/sample_vectors.h"

HWY_BEFORE_NAMESPACE();
namespace bilayer::detail::HWY_NAMESPACE {
namespace {

constexpr int xStep = FieldFrame::stride * FieldFrame::stride, yStep = FieldFrame::stride;

/// The voxels around a place at its lower and at its upper x: (y, z), (y, z + 1), (y + 1, z), (y + 1, z + 1). For two
/// places, one after the other.
template <class Vector>
struct CellLanes {
    Vector low, high;
    bool beyond;  ///< fixed16: some are outside the band; float32 voxels there are NaN instead
};

/// Two neighbours along z, and the two next to them along y.
HWY_INLINE Floats loadPairs(const float* v) {
    using Pair [[gnu::vector_size(8)]] = float;
    return __builtin_shufflevector(load<Pair>(v), load<Pair>(v + yStep), 0, 1, 2, 3);
}

HWY_INLINE CellLanes<Floats> loadCell(const float* v) {
    return {loadPairs(v), loadPairs(v + xStep), false};
}

HWY_INLINE CellLanes<EightFloats> loadCells(const float* v, const float* w) {
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

HWY_INLINE EightFloats toFloats(Steps steps) {
    return __builtin_convertvector(__builtin_convertvector(steps, EightInts), EightFloats);
}

HWY_INLINE CellLanes<Floats> loadCell(const std::int16_t* v) {
    const Steps steps = loadSteps(v);
    const EightFloats values = toFloats(steps);
    return {__builtin_shufflevector(values, values, 0, 1, 2, 3), __builtin_shufflevector(values, values, 4, 5, 6, 7),
            anyBeyondBand(steps)};
}

HWY_INLINE CellLanes<EightFloats> loadCells(const std::int16_t* v, const std::int16_t* w) {
    const Steps first = loadSteps(v), second = loadSteps(w);
    return {toFloats(__builtin_shufflevector(first, second, 0, 1, 2, 3, 8, 9, 10, 11)),
            toFloats(__builtin_shufflevector(first, second, 4, 5, 6, 7, 12, 13, 14, 15)),
            anyBeyondBand(first) || anyBeyondBand(second)};
}

/// The value and its gradient per voxel. The fractions of the place are in all lanes.
template <class Vector>
HWY_INLINE Vector interpolate(const CellLanes<Vector>& cell, Vector x, Vector y, Vector z) {
    const Vector dx = cell.high - cell.low, at = cell.low + x * dx;
    // values at z and z + 1, then their slopes along x
    const Vector y0 = lowerHalves(at, dx), y1 = upperHalves(at, dx);
    const Vector dy = y1 - y0, between = y0 + y * dy;
    // value, slope along x, slope along y
    const Vector z0 = evenLanes(between, dy), z1 = oddLanes(between, dy);
    const Vector dz = z1 - z0, found = z0 + z * dz;
    return withFourth(found, dz);
}

HWY_INLINE Floats interpolate(const CellLanes<Floats>& cell, Floats fraction) {
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

}  // namespace
}  // namespace bilayer::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
