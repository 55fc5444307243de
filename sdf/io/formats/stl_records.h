// SPDX-License-Identifier: Apache-2.0
// The layout of binary STL files; internal.
// Tested by tests/sdf/triangle_source.cpp through trianglesOfFile().
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string_view>

namespace bilayer::detail {

inline constexpr std::size_t stlHeaderBytes = 80, stlFacetBytes = 50, stlNormalBytes = 12;

/// Returns the count of facets that a binary file announces; 0 if it is too short.
inline std::uint32_t stlFacetCount(std::string_view bytes) {
    std::uint32_t count = 0;
    if (bytes.size() >= stlHeaderBytes + sizeof count) std::memcpy(&count, bytes.data() + stlHeaderBytes, sizeof count);
    return count;
}

/// Returns the size of a binary file with this count of facets.
inline std::uint64_t stlBinarySize(std::uint64_t facets) {
    return stlHeaderBytes + sizeof(std::uint32_t) + stlFacetBytes * facets;
}

}  // namespace bilayer::detail
