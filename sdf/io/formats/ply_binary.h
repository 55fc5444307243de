// SPDX-License-Identifier: Apache-2.0
// Binary data of a PLY file: values of each type in either byte order; internal.
// Tested by tests/sdf/ply_reader.cpp through readMesh().
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "sdf/io/formats/ply_header.h"

namespace bilayer::detail {

inline constexpr std::size_t plyTaskElements = 1 << 14;  ///< elements per task, for binary data

/// The unread part of a file's binary data.
struct PlyData {
    const char *at, *end;
    bool swapped;  ///< the byte order is not this machine's

    std::size_t size() const { return std::size_t(end - at); }
};

template <class Value>
inline Value loadPly(const char* from, bool swapped) {
    std::array<char, sizeof(Value)> bytes;
    std::memcpy(bytes.data(), from, sizeof(Value));
    if (swapped) std::reverse(bytes.begin(), bytes.end());
    return std::bit_cast<Value>(bytes);
}

/// Calls visit(Value()) with a default value of a type.
template <class Visit>
inline auto withPlyType(PlyType type, Visit visit) {
    switch (type) {
        case PlyType::int8:
            return visit(std::int8_t());
        case PlyType::uint8:
            return visit(std::uint8_t());
        case PlyType::int16:
            return visit(std::int16_t());
        case PlyType::uint16:
            return visit(std::uint16_t());
        case PlyType::int32:
            return visit(std::int32_t());
        case PlyType::uint32:
            return visit(std::uint32_t());
        case PlyType::float32:
            return visit(float());
        default:
            return visit(double());
    }
}

}  // namespace bilayer::detail
