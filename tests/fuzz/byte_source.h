// SPDX-License-Identifier: Apache-2.0
// Numbers from the bytes of a fuzzer. Behind the last byte all numbers are zero.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <glm/gtc/quaternion.hpp>
#include <glm/vec3.hpp>
#include <iterator>
#include <limits>

#include "tests/fuzz/checks.h"

namespace bilayer::test {

class ByteSource {
  public:
    explicit ByteSource(Bytes bytes) : bytes_(bytes) {}

    bool empty() const { return bytes_.empty(); }
    std::uint8_t byte() { return number<std::uint8_t>(); }
    bool flag() { return byte() & 1; }
    /// A whole number in [0, count).
    unsigned below(unsigned count) { return number<std::uint16_t>() % count; }
    /// A number in [-1, 1] in steps of 1/127.
    float lattice() { return float(std::max(number<std::int8_t>(), std::int8_t(-127))) / 127; }

    /// Any float, often a special one or one of everyday size.
    float anyFloat() {
        constexpr float special[] = {0.f,
                                     -0.f,
                                     1.f,
                                     -1.f,
                                     0.5f,
                                     std::numeric_limits<float>::quiet_NaN(),
                                     std::numeric_limits<float>::infinity(),
                                     -std::numeric_limits<float>::infinity(),
                                     std::numeric_limits<float>::denorm_min(),
                                     std::numeric_limits<float>::min(),
                                     std::numeric_limits<float>::max(),
                                     std::numeric_limits<float>::lowest(),
                                     1e30f,
                                     -1e-30f,
                                     1e18f,
                                     1e-18f};
        const std::uint8_t kind = byte();
        if (kind < 64) return special[kind % std::size(special)];
        if (kind < 160) return lattice();
        return number<float>();
    }
    glm::vec3 anyVector() {
        const float x = anyFloat(), y = anyFloat(), z = anyFloat();
        return {x, y, z};
    }
    glm::vec3 latticePoint() {
        const float x = lattice(), y = lattice(), z = lattice();
        return {x, y, z};
    }
    glm::quat anyRotation() {
        const float w = anyFloat(), x = anyFloat(), y = anyFloat(), z = anyFloat();
        return {w, x, y, z};
    }

    template <class Value>
    Value number() {
        Value value{};
        const std::size_t size = std::min(sizeof value, bytes_.size());
        if (size > 0) std::memcpy(&value, bytes_.data(), size);
        bytes_ = bytes_.subspan(size);
        return value;
    }

  private:
    Bytes bytes_;
};

}  // namespace bilayer::test
