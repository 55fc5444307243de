// SPDX-License-Identifier: Apache-2.0
// Memory bandwidth of this machine and the memory traffic of samples: the lower bound of their time.
#pragma once

#include <cstddef>
#include <glm/vec3.hpp>
#include <span>

#include "collider/field/layout/field_layout.h"

namespace bilayer::bench {

inline constexpr std::size_t cacheLine = 64;  // [bytes]

/// Bytes per second that `threads` threads read together from a buffer far larger than the caches, in sequence.
double streamBandwidth(int threads);

/// Cache lines of 64 bytes per second that `threads` threads read together at random places of a buffer. Each thread
/// has many reads in flight. The buffer uses the largest pages that the machine grants.
/// @param bytes  size of the buffer; a buffer that fits into a cache is read from there
double randomLines(std::size_t bytes, int threads);

/// Cache lines that samples of a field read.
struct Touched {
    double linesEach = 0;    ///< per sample, on average
    double linesShared = 0;  ///< distinct lines over all samples, per sample
};
Touched linesTouched(const detail::FieldLayout& field, std::span<const glm::vec3> points);

}  // namespace bilayer::bench
