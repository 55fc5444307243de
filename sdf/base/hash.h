// SPDX-License-Identifier: Apache-2.0
// Steps of hashes of 64 bits. Their results are stored in files, and must stay the same.
// Tested by tests/sdf/mesh.cpp through hash().
#pragma once

#include <cstdint>

namespace bilayer::detail {

/// Mixes every bit of a word into all others: the finalizer of SplitMix64 (G. Steele, D. Lea, C. Flood, "Fast
/// splittable pseudorandom number generators", 2014; constants by S. Vigna). Zero stays zero.
constexpr std::uint64_t mixedBits(std::uint64_t word) {
    word = (word ^ (word >> 30)) * 0xbf58476d1ce4e5b9u;
    word = (word ^ (word >> 27)) * 0x94d049bb133111ebu;
    return word ^ (word >> 31);
}

/// SplitMix64: a hash of a word.
constexpr std::uint64_t splitMix64(std::uint64_t word) {
    return mixedBits(word + 0x9e3779b97f4a7c15u);
}

/// Continues a hash by a word: an FNV-1a step on 64 bits, with the high bits folded down.
constexpr std::uint64_t mixedHash(std::uint64_t hash, std::uint64_t word) {
    constexpr std::uint64_t prime = 0x100000001b3u;
    const std::uint64_t product = (hash ^ word) * prime;
    return product ^ (product >> 32);
}

}  // namespace bilayer::detail
