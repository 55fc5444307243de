// SPDX-License-Identifier: Apache-2.0
// The positions of the set bits of each byte.
// Tested by tests/sdf/compress.cpp through Compressor.
#pragma once

#include <array>
#include <cstdint>

namespace bilayer::detail {

/// For each byte, the positions of its set bits in ascending order, then zeros.
alignas(64) inline constexpr std::array<std::array<std::uint8_t, 8>, 256> bitOrders = [] {
    std::array<std::array<std::uint8_t, 8>, 256> orders{};
    for (unsigned byte = 0; byte < orders.size(); ++byte)
        for (unsigned bit = 0, at = 0; bit < 8; ++bit)
            if (byte >> bit & 1) orders[byte][at++] = std::uint8_t(bit);
    return orders;
}();

}  // namespace bilayer::detail
