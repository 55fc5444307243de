// SPDX-License-Identifier: Apache-2.0
// Vectors of three components in SIMD lanes: one vector per lane. Highway includes this file once for each instruction
// set: only between HWY_BEFORE_NAMESPACE's headers and its own, after hwy/highway.h.
// Tested by tests/sdf/wide_tree.cpp.
#if defined(BILAYER_SDF_VECTOR_LANES_H) == defined(HWY_TARGET_TOGGLE)
#ifdef BILAYER_SDF_VECTOR_LANES_H
#undef BILAYER_SDF_VECTOR_LANES_H
#else
#define BILAYER_SDF_VECTOR_LANES_H
#endif

#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace bilayer::detail::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

/// Vectors or points, one per lane of the tag D.
template <class D>
struct VectorLanes {
    hn::Vec<D> x, y, z;
};

template <class D>
HWY_INLINE VectorLanes<D> operator+(const VectorLanes<D>& a, const VectorLanes<D>& b) {
    return {hn::Add(a.x, b.x), hn::Add(a.y, b.y), hn::Add(a.z, b.z)};
}

template <class D>
HWY_INLINE VectorLanes<D> operator-(const VectorLanes<D>& a, const VectorLanes<D>& b) {
    return {hn::Sub(a.x, b.x), hn::Sub(a.y, b.y), hn::Sub(a.z, b.z)};
}

template <class D>
HWY_INLINE VectorLanes<D> scaled(const VectorLanes<D>& a, hn::Vec<D> factor) {
    return {hn::Mul(a.x, factor), hn::Mul(a.y, factor), hn::Mul(a.z, factor)};
}

template <class D>
HWY_INLINE hn::Vec<D> dot(const VectorLanes<D>& a, const VectorLanes<D>& b) {
    return hn::Add(hn::Add(hn::Mul(a.x, b.x), hn::Mul(a.y, b.y)), hn::Mul(a.z, b.z));
}

template <class D>
HWY_INLINE VectorLanes<D> cross(const VectorLanes<D>& a, const VectorLanes<D>& b) {
    return {hn::Sub(hn::Mul(a.y, b.z), hn::Mul(a.z, b.y)), hn::Sub(hn::Mul(a.z, b.x), hn::Mul(a.x, b.z)),
            hn::Sub(hn::Mul(a.x, b.y), hn::Mul(a.y, b.x))};
}

/// Returns three arrays from index `i` on as vectors.
template <class D, std::size_t n>
HWY_INLINE VectorLanes<D> loadLanes(D tag, const hn::TFromD<D> (&from)[3][n], std::size_t i) {
    return {hn::Load(tag, from[0] + i), hn::Load(tag, from[1] + i), hn::Load(tag, from[2] + i)};
}

}  // namespace bilayer::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
