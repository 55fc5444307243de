// SPDX-License-Identifier: Apache-2.0
// The vectors of field samples, in the compiler's own types, with loads, conversions and shuffles. Highway includes
// this file once for each instruction set: only between HWY_BEFORE_NAMESPACE's headers and its own, after
// hwy/highway.h.
// Tested by tests/collider/field.cpp through Field::sample().
#if defined(BILAYER_COLLIDER_SAMPLE_VECTORS_H) == defined(HWY_TARGET_TOGGLE)
#ifdef BILAYER_COLLIDER_SAMPLE_VECTORS_H
#undef BILAYER_COLLIDER_SAMPLE_VECTORS_H
#else
#define BILAYER_COLLIDER_SAMPLE_VECTORS_H
#endif

#include <hwy/highway.h>

#include <cstdint>
#include <cstring>

#include "collider/field/samples/field_data.h"

// wider vectors than those of the baseline instruction set are only passed between inlined functions
#pragma GCC diagnostic ignored "-Wpsabi"

HWY_BEFORE_NAMESPACE();
namespace bilayer::detail::HWY_NAMESPACE {
namespace {

using Words [[gnu::vector_size(16)]] = std::uint32_t;
using FourDoubles [[gnu::vector_size(32)]] = double;
using EightFloats [[gnu::vector_size(32)]] = float;  // of two places
using EightInts [[gnu::vector_size(32)]] = std::int32_t;

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

HWY_INLINE bool equal(Words a, Words b) {
#if HWY_ARCH_X86
    return __builtin_ia32_movmskps(reinterpret_cast<Floats>(a == b)) == 0xf;
#else
    using Long [[gnu::vector_size(16)]] = std::uint64_t;
    const Long differences = reinterpret_cast<Long>(a ^ b);
    return (differences[0] | differences[1]) == 0;
#endif
}

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
HWY_INLINE EightFloats lowerHalves(EightFloats a, EightFloats b) {
    return __builtin_shufflevector(a, b, 0, 1, 8, 9, 4, 5, 12, 13);
}
HWY_INLINE EightFloats upperHalves(EightFloats a, EightFloats b) {
    return __builtin_shufflevector(a, b, 2, 3, 10, 11, 6, 7, 14, 15);
}
HWY_INLINE EightFloats evenLanes(EightFloats a, EightFloats b) {
    return __builtin_shufflevector(a, b, 0, 2, 8, 10, 4, 6, 12, 14);
}
HWY_INLINE EightFloats oddLanes(EightFloats a, EightFloats b) {
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
HWY_INLINE EightFloats withFourth(EightFloats a, EightFloats b) {
    return __builtin_shufflevector(a, b, 0, 1, 2, 8, 4, 5, 6, 12);
}
HWY_INLINE EightFloats both(Floats a, Floats b) {
    return __builtin_shufflevector(a, b, 0, 1, 2, 3, 4, 5, 6, 7);
}

}  // namespace
}  // namespace bilayer::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
