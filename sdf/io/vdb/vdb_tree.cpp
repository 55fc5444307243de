// SPDX-License-Identifier: Apache-2.0
#include "sdf/io/vdb/vdb_tree.h"

#include <fmt/format.h>

#include <bit>
#include <span>
#include <stdexcept>

namespace bilayer::detail {
namespace {

/// Voxels along the nodes of a tree, from the coarsest to the leaves, as powers of two.
constexpr int coarse = 5, fine = 4, leaf = 3;

constexpr std::uint64_t cube(int log2) {
    return std::uint64_t(1) << 3 * log2;
}
static_assert(cube(leaf) == vdbLeafVoxels);

std::uint64_t countBits(std::span<const std::uint64_t> words) {
    std::uint64_t bits = 0;
    for (const std::uint64_t word : words) bits += std::uint64_t(std::popcount(word));
    return bits;
}

// Returns the count of set bits.
std::uint64_t readMask(VdbStream& in, int log2) {
    std::array<std::uint64_t, cube(coarse) / 64> words;
    const std::uint64_t count = cube(log2) / 64;
    in.read(words.data(), count * sizeof(std::uint64_t));
    return countBits(std::span(words).first(count));
}

void skipBytes(VdbStream& in, const VdbValueFormat& format, std::uint64_t expected) {
    if (!format.zip && !format.blosc) return in.skip(expected, "values");
    const auto length = in.read<std::int64_t>();
    if (length > 0)
        return format.blosc ? in.skipBlosc(std::uint64_t(length), expected) : in.skip(std::uint64_t(length), "values");
    // a negative length is that of values that are not compressed; unsigned, since the lowest one has no opposite
    const std::uint64_t plain = 0 - std::uint64_t(length);
    if (plain != expected)
        throw std::runtime_error(fmt::format("{} bytes of values, where {} are expected", plain, expected));
    in.skip(plain, "values");
}

void skipValues(VdbStream& in, const VdbValueFormat& format, std::uint64_t count, std::uint64_t active) {
    // storage of inactive values: all of them, or the values that they have in common
    enum : std::int8_t { oneValue = 2, mask = 3, maskAndOneValue = 4, maskAndTwoValues = 5, allValues = 6 };
    const auto kind = in.read<std::int8_t>();
    if (kind == oneValue || kind == maskAndOneValue || kind == maskAndTwoValues)
        in.skip(format.size * (kind == maskAndTwoValues ? 2 : 1), "an inactive value");
    if (kind == mask || kind == maskAndOneValue || kind == maskAndTwoValues) in.skip(count / 8, "a mask");
    const std::uint64_t stored = format.activeOnly && kind != allValues ? active : count;
    if (format.half && stored == 0) return;
    skipBytes(in, format, stored * (format.half ? format.halfSize : format.size));
}

void skipNode(VdbStream& in, const VdbValueFormat& format, int log2, std::vector<VdbLeafMask>& leaves) {
    const std::uint64_t children = readMask(in, log2), active = readMask(in, log2);
    skipValues(in, format, cube(log2), active);
    for (std::uint64_t i = 0; i < children; ++i) {
        if (log2 == coarse)
            skipNode(in, format, fine, leaves);
        else
            leaves.push_back(in.read<VdbLeafMask>());
    }
}

}  // namespace

std::vector<VdbLeafMask> skipVdbTopology(VdbStream& in, const VdbValueFormat& format) {
    using Origin = std::array<std::int32_t, 3>;
    if (in.read<std::int32_t>() != 1) throw std::runtime_error("a tree with more than one buffer");
    in.skip(format.size, "a background");
    const auto tiles = in.read<std::uint32_t>(), children = in.read<std::uint32_t>();
    in.skip(tiles * (sizeof(Origin) + format.size + 1), "tiles");
    std::vector<VdbLeafMask> leaves;
    Origin last;
    for (std::uint32_t i = 0; i < children; ++i) {
        const auto origin = in.read<Origin>();
        // leaves are read again in this order; of two nodes at one position, one is lost
        if (i > 0 && !(last < origin)) throw std::runtime_error("nodes of a tree that are not in order");
        last = origin;
        skipNode(in, format, coarse, leaves);
    }
    return leaves;
}

void skipVdbLeaves(VdbStream& in, const VdbValueFormat& format, const std::vector<VdbLeafMask>& leaves) {
    for (const VdbLeafMask& expected : leaves) {
        requireLeafMask(in, expected);
        skipValues(in, format, vdbLeafVoxels, countBits(expected));
    }
}

void requireLeafMask(VdbStream& in, const VdbLeafMask& expected) {
    if (in.read<VdbLeafMask>() != expected) throw std::runtime_error("a leaf with two masks");
}

}  // namespace bilayer::detail
