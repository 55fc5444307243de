// SPDX-License-Identifier: Apache-2.0
// Moves the lanes of a mask to the front of a vector. Highway includes this file once for each instruction set: only
// between HWY_BEFORE_NAMESPACE's headers and its own, after hwy/highway.h.
// Tested by tests/sdf/compress.cpp.
#if defined(BILAYER_SDF_COMPRESS_H) == defined(HWY_TARGET_TOGGLE)
#ifdef BILAYER_SDF_COMPRESS_H
#undef BILAYER_SDF_COMPRESS_H
#else
#define BILAYER_SDF_COMPRESS_H
#endif

#include <hwy/highway.h>

#include <bit>
#include <cstddef>
#include <cstdint>

#include "sdf/base/bit_orders.h"

HWY_BEFORE_NAMESPACE();
namespace bilayer::detail::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;
namespace {

/// Moves the lanes of one mask in any number of vectors of 32-bit numbers, in ascending order. The lanes behind them
/// are arbitrary. hn::Compress() of Highway 1.0 copies a table of a kilobyte at each call for AVX2.
template <class D>
class Compressor {
  public:
#if HWY_TARGET <= HWY_AVX3
    Compressor(D tag, hn::Mask<D> mask) : mask_(mask), count_(hn::CountTrue(tag, mask)) {}
    template <class E>
    HWY_INLINE hn::Vec<E> operator()(E tag, hn::Vec<E> values) const {
        return hn::Compress(values, hn::RebindMask(tag, mask_));
    }
#else
    Compressor(D tag, hn::Mask<D> mask) {
        static_assert(hn::MaxLanes(D()) <= 8 && sizeof(hn::TFromD<D>) == 4);
        std::uint8_t bits[8] = {};
        hn::StoreMaskBits(tag, mask, bits);
        count_ = std::size_t(std::popcount(bits[0]));
        order_ = bitOrders[bits[0]].data();
    }
    template <class E>
    HWY_INLINE hn::Vec<E> operator()(E tag, hn::Vec<E> values) const {
        const hn::RebindToUnsigned<E> indexTag;
        const auto order = hn::PromoteTo(indexTag, hn::LoadU(hn::Rebind<std::uint8_t, E>(), order_));
        return hn::TableLookupLanes(values, hn::IndicesFromVec(tag, order));
    }
#endif
    /// Writes a whole vector: the lanes of the mask first.
    template <class E>
    HWY_INLINE void store(E tag, hn::Vec<E> values, hn::TFromD<E>* to) const {
        hn::StoreU((*this)(tag, values), tag, to);
    }
    HWY_INLINE std::size_t count() const {
        return count_;
    }  ///< lanes of the mask

  private:
#if HWY_TARGET <= HWY_AVX3
    hn::Mask<D> mask_;
#else
    const std::uint8_t* order_;
#endif
    std::size_t count_;
};

}  // namespace
}  // namespace bilayer::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
