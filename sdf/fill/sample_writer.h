// SPDX-License-Identifier: Apache-2.0
// Appends samples of the double layer method, one per SIMD lane. Highway includes this file once for each instruction
// set: only between HWY_BEFORE_NAMESPACE's headers and its own, after hwy/highway.h.
// Tested by tests/sdf/double_layer.cpp through build().
#if defined(BILAYER_SDF_SAMPLE_WRITER_H) == defined(HWY_TARGET_TOGGLE)
#ifdef BILAYER_SDF_SAMPLE_WRITER_H
#undef BILAYER_SDF_SAMPLE_WRITER_H
#else
#define BILAYER_SDF_SAMPLE_WRITER_H
#endif

#include <hwy/highway.h>

#include <cstddef>

#include "sdf/base/compress.h"
#include "sdf/base/vector_lanes.h"
#include "sdf/fill/layer_samples.h"

HWY_BEFORE_NAMESPACE();
namespace bilayer::detail::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;
namespace {

class SampleWriter {
  public:
    /// @param to  receives the samples
    SampleWriter(const SampleCells& cells, AddedSamples& to) : cells_(cells), to_(to) {}

    /// Adds the samples in the mask `among`, except those too far from the brick.
    template <class D>
    HWY_INLINE void put(D tag, hn::Mask<D> among, const VectorLanes<D>& place, const VectorLanes<D>& offset,
                        hn::Vec<hn::RebindToSigned<D>> triangle) {
        const hn::RebindToSigned<D> intTag;
        const auto within = [&](auto at, int axis) {
            return hn::And(hn::Ge(at, hn::Set(tag, cells_.lower[axis])), hn::Le(at, hn::Set(tag, cells_.upper[axis])));
        };
        const auto near = hn::And(hn::And(among, within(place.x, 0)), hn::And(within(place.y, 1), within(place.z, 2)));
        const auto cellAt = [&](auto at) {
            return hn::ConvertTo(intTag, hn::Mul(hn::Sub(at, hn::Set(tag, cells_.firstCorner)),
                                                 hn::Set(tag, 1.f / float(LayerSamples::cellSide))));
        };
        const auto size = hn::Set(intTag, cells_.size);
        const auto cell =
            hn::Add(hn::Mul(hn::Add(hn::Mul(cellAt(place.x), size), cellAt(place.y)), size), cellAt(place.z));
        to_.reserve(to_.count + hn::Lanes(tag));
        const Compressor<D> kept(tag, near);
        kept.store(tag, place.x, to_.columns.place[0].data() + to_.count);
        kept.store(tag, place.y, to_.columns.place[1].data() + to_.count);
        kept.store(tag, place.z, to_.columns.place[2].data() + to_.count);
        kept.store(tag, offset.x, to_.columns.offset[0].data() + to_.count);
        kept.store(tag, offset.y, to_.columns.offset[1].data() + to_.count);
        kept.store(tag, offset.z, to_.columns.offset[2].data() + to_.count);
        kept.store(intTag, triangle, to_.columns.triangle.data() + to_.count);
        kept.store(intTag, cell, to_.cell.data() + to_.count);
        to_.count += kept.count();
    }

  private:
    const SampleCells& cells_;
    AddedSamples& to_;
};

}  // namespace
}  // namespace bilayer::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
