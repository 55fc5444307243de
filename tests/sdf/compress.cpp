// SPDX-License-Identifier: Apache-2.0
// Lanes moved to the front of a vector, for every mask, by the instruction set of this processor.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "tests/sdf/compress.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cstdint>
#include <vector>

#include "sdf/base/compress.h"

#ifndef BILAYER_TESTS_SDF_COMPRESS
#define BILAYER_TESTS_SDF_COMPRESS
namespace bilayer::test {

// The lanes that remain of floats and integers that count from zero.
struct KeptLanes {
    std::vector<float> floats;
    std::vector<std::uint32_t> integers;
};

}  // namespace bilayer::test
#endif

HWY_BEFORE_NAMESPACE();
namespace bilayer::detail::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;
namespace {

using Tag = hn::CappedTag<float, 16>;

std::size_t laneCount() {
    return hn::Lanes(Tag());
}

test::KeptLanes keep(std::uint32_t bits) {
    const Tag tag;
    const hn::RebindToUnsigned<Tag> intTag;
    alignas(64) float chosen[16] = {}, floats[16];
    alignas(64) std::uint32_t integers[16];
    for (std::size_t i = 0; i < hn::Lanes(tag); ++i) chosen[i] = float(bits >> i & 1);
    const Compressor<Tag> kept(tag, hn::Gt(hn::Load(tag, chosen), hn::Zero(tag)));
    hn::Store(kept(tag, hn::Iota(tag, 0)), tag, floats);
    hn::Store(kept(intTag, hn::Iota(intTag, 0)), intTag, integers);
    return {{floats, floats + kept.count()}, {integers, integers + kept.count()}};
}

}  // namespace
}  // namespace bilayer::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
using namespace bilayer::detail;

namespace bilayer::detail {
HWY_EXPORT(keep);
HWY_EXPORT(laneCount);
}  // namespace bilayer::detail

TEST_CASE("the lanes of any mask move to the front in ascending order") {
    const std::size_t lanes = HWY_DYNAMIC_DISPATCH(laneCount)();
    REQUIRE(lanes >= 1);
    REQUIRE(lanes <= 16);
    for (std::uint32_t bits = 0; bits < 1u << lanes; ++bits) {
        std::vector<std::uint32_t> expected;
        for (std::uint32_t i = 0; i < lanes; ++i)
            if (bits >> i & 1) expected.push_back(i);
        const bilayer::test::KeptLanes kept = HWY_DYNAMIC_DISPATCH(keep)(bits);
        CAPTURE(bits);
        CHECK(kept.integers == expected);
        CHECK(std::equal(kept.floats.begin(), kept.floats.end(), expected.begin(), expected.end(),
                         [](float value, std::uint32_t lane) { return value == float(lane); }));
    }
}
#endif  // HWY_ONCE
