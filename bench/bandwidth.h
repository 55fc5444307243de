// What the memory of this machine gives, and what samples ask of it: the floor under their time.
#pragma once

#include <cstddef>
#include <glm/vec3.hpp>
#include <span>

#include "collider/field/field_layout.h"

namespace bilayer::bench {

using namespace bilayer::detail;

inline constexpr std::size_t cacheLine = 64;  // [bytes]

/// Bytes a second that `threads` threads read together from memory, one after the other, far beyond the caches.
double streamBandwidth(int threads);

/// Lines of 64 bytes a second that `threads` threads read together at random places of a buffer, many at once, from
/// pages as large as the machine has them.
/// @param bytes  of the buffer: what fits into a cache comes from there
double randomLines(std::size_t bytes, int threads);

/// Lines of memory that samples read of a field.
struct Touched {
    double linesEach = 0;    ///< by one sample, in the mean
    double linesShared = 0;  ///< by all of them together, each line once, for each sample
};
Touched linesTouched(const FieldLayout& field, std::span<const glm::vec3> points);

}  // namespace bilayer::bench
