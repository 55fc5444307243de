// SPDX-License-Identifier: Apache-2.0
// Places in a field as fixed-point numbers. The upper word of a number is the block; its lower word is the voxel in the
// block and the fraction to the next voxel. Highway includes this file once for each instruction set: only between
// HWY_BEFORE_NAMESPACE's headers and its own, after hwy/highway.h.
// Tested by tests/collider/field.cpp through Field::sample().
#if defined(BILAYER_COLLIDER_SAMPLE_PLACE_H) == defined(HWY_TARGET_TOGGLE)
#ifdef BILAYER_COLLIDER_SAMPLE_PLACE_H
#undef BILAYER_COLLIDER_SAMPLE_PLACE_H
#else
#define BILAYER_COLLIDER_SAMPLE_PLACE_H
#endif

#include <hwy/highway.h>

#include <array>
#include <bit>
#include <cstdint>
#include <glm/vec3.hpp>

#include "collider/field/samples/field_data.h"
#include "collider/field/samples/sample_vectors.h"

HWY_BEFORE_NAMESPACE();
namespace bilayer::detail::HWY_NAMESPACE {
namespace {

/// The upper word of a place in the directory's first block.
constexpr auto firstBlock = std::uint32_t(std::bit_cast<std::uint64_t>(FieldData::fixedPoint) >> 32);

/// A place along the three axes, in fixed point.
struct FixedPlace {
    /// In the directory. Negative, huge and NaN coordinates are all out of its range.
    std::array<std::uint32_t, 3> block;
    std::array<std::uint32_t, 3> inBlock;  ///< the voxel in the upper bits, the fraction to the next in the lower ones
    Floats fraction;                       ///< as floats: x, y, y, z
};

HWY_INLINE Floats fractionOf(const FieldData& field, Words inBlock) {
    return __builtin_convertvector(reinterpret_cast<Ints>(inBlock) & field.lanes.fraction, Floats) *
           field.lanes.fractionUnit;
}

/// A place as fixed-point numbers in the lower bits of doubles.
struct FixedNumbers {
    Doubles xy, yz;

    /// The upper words, along x, y, y, z: the block.
    HWY_INLINE Words upper() const {
        return __builtin_shufflevector(reinterpret_cast<Words>(xy), reinterpret_cast<Words>(yz), 1, 3, 5, 7);
    }
    /// The lower words, along x, y, y, z: the place in the block.
    HWY_INLINE Words lower() const {
        return __builtin_shufflevector(reinterpret_cast<Words>(xy), reinterpret_cast<Words>(yz), 0, 2, 4, 6);
    }
};

/// Two loads of eight bytes give [x, y] and [y, z].
HWY_INLINE FixedNumbers numbersOf(const FieldData& field, const glm::vec3& point) {
    const Doubles xy{load<double>(&point.x), 0}, yz{load<double>(&point.y), 0};
    return {lowerAsDoubles(reinterpret_cast<Floats>(xy)) * field.lanes.perMetre + field.lanes.offsetXy,
            lowerAsDoubles(reinterpret_cast<Floats>(yz)) * field.lanes.perMetre + field.lanes.offsetYz};
}

/// @param local  from the directory's first voxel [voxels]
HWY_INLINE FixedNumbers numbersOf(const FieldData&, const glm::dvec3& local) {
    constexpr double zero = FieldData::fixedPoint;
    return {Doubles{local.x, local.y} + zero, Doubles{local.y, local.z} + zero};
}

/// The blocks are computed in general-purpose registers, in parallel with the vector units, which the interpolation
/// keeps busy.
HWY_INLINE FixedPlace placeOf(const FieldData& field, const FixedNumbers& numbers) {
    const auto words = [](double fixed) { return std::bit_cast<std::uint64_t>(fixed); };
    const std::uint64_t x = words(numbers.xy[0]), y = words(numbers.yz[0]), z = words(numbers.yz[1]);
    return {
        {std::uint32_t(x >> 32) - firstBlock, std::uint32_t(y >> 32) - firstBlock, std::uint32_t(z >> 32) - firstBlock},
        {std::uint32_t(x), std::uint32_t(y), std::uint32_t(z)},
        fractionOf(field, numbers.lower())};
}

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

}  // namespace
}  // namespace bilayer::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
