// What the memory of this machine gives: the floor under anything that reads it.
#pragma once

#include <cstddef>

namespace bilayer::bench {

inline constexpr std::size_t cacheLine = 64;  // [bytes]

/// Bytes a second that `threads` threads read together from memory, one after the other, far beyond the caches.
double streamBandwidth(int threads);

/// Lines of 64 bytes a second that `threads` threads read together at random places of a buffer, many at once, from
/// pages as large as the machine has them.
/// @param bytes  of the buffer: what fits into a cache comes from there
double randomLines(std::size_t bytes, int threads);

}  // namespace bilayer::bench
