// SPDX-License-Identifier: Apache-2.0
// Morton order: points that are close in space are mostly close in this order.
// Tested by tests/sdf/flood.cpp.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace bilayer::detail {

/// Returns whether one cell comes before another in Morton order. The axis whose coordinates differ in the highest bit
/// decides; on a tie, the first such axis decides. No Morton keys are built.
inline bool beforeInMortonOrder(const std::array<std::uint32_t, 3>& a, const std::array<std::uint32_t, 3>& b) {
    std::size_t axis = 0;
    std::uint32_t most = a[0] ^ b[0];
    for (std::size_t other = 1; other < 3; ++other) {
        const std::uint32_t differing = a[other] ^ b[other];
        if (most < differing && most < (most ^ differing)) {
            most = differing;
            axis = other;
        }
    }
    return a[axis] < b[axis];
}

}  // namespace bilayer::detail
