// SPDX-License-Identifier: Apache-2.0
#include "sdf/io/vdb/vdb_stream.h"

#include <fmt/format.h>
#include <openvdb/Metadata.h>

#include <stdexcept>

#include "sdf/base/quoted_text.h"

namespace bilayer::detail {
namespace {

/// Blosc pads shorter data up to this size [bytes].
constexpr std::uint64_t bloscPadding = 128;

}  // namespace

void VdbStream::failLength(std::uint64_t length, const char* what) const {
    throw std::runtime_error(fmt::format("{} of {} bytes, where {} are left", what, length, left_));
}

void VdbStream::read(void* to, std::uint64_t size) {
    require(size, "a number");
    in_.read(static_cast<char*>(to), std::streamsize(size));
    left_ -= size;
}

void VdbStream::skip(std::uint64_t length, const char* what) {
    require(length, what);
    in_.ignore(std::streamsize(length));
    left_ -= length;
}

std::string VdbStream::readName() {
    const auto length = read<std::uint32_t>();
    require(length, "a name");
    std::string name(length, ' ');
    read(name.data(), length);
    return name;
}

void VdbStream::skipBlosc(std::uint64_t length, std::uint64_t expected) {
    struct Head {
        std::uint8_t versions[2], flags, valueSize;
        std::uint32_t bytes, blockBytes, compressed;
    };
    static_assert(sizeof(Head) == 16);
    require(length, "compressed values");
    if (length < sizeof(Head)) throw std::runtime_error("compressed values that are too short");
    const auto head = read<Head>();
    if (head.compressed != length)
        throw std::runtime_error(fmt::format("{} bytes of values, which state {}", length, head.compressed));
    const bool padded = expected <= bloscPadding && head.bytes == bloscPadding;
    if ((head.bytes != expected && !padded) || head.bytes > maxLz4Expansion * length)
        throw std::runtime_error(fmt::format("{} bytes of values, where {} are expected", head.bytes, expected));
    skip(length - sizeof(Head), "compressed values");
}

// Skips the delayed-load metadata, which describes how to read the leaves. OpenVDB drops it, but allocates memory for
// it first. Grids without leaves, and those of types that are not loaded later, have none of it.
void VdbStream::skipDelayedLoad(std::uint64_t size) {
    if (size == 0) return;
    require(size, "metadata");
    const std::uint64_t end = left_ - size;
    const auto count = read<std::uint32_t>();
    const auto skipList = [&](std::uint64_t itemBytes) {
        const auto compressed = read<std::uint32_t>();
        if (compressed == ~std::uint32_t(0)) return;
        const std::uint64_t bytes = count * itemBytes;
        compressed ? skipBlosc(compressed, bytes) : skip(bytes, "a list of leaves");
    };
    skipList(sizeof(std::int8_t));
    skipList(sizeof(std::int64_t));
    if (left_ < end) throw std::runtime_error("a list of leaves that is too long");
    skip(left_ - end, "metadata");
}

void VdbStream::skipMetadata() {
    const auto count = read<std::uint32_t>();
    for (std::uint32_t i = 0; i < count; ++i) {
        const std::string name = readName(), type = readName();
        const std::uint64_t size = read<std::uint32_t>();
        if (type == "__delayedload") {
            skipDelayedLoad(size);
            continue;
        }
        // values of known types are read at their own size, whatever size is stored
        const bool fixed = type != "string" && openvdb::Metadata::isRegisteredType(type);
        const std::uint64_t expected = fixed ? openvdb::Metadata::createMetadata(type)->size() : size;
        if (size != expected)
            throw std::runtime_error(
                fmt::format("{} of {} bytes, where {} are expected", quotedWord(name), size, expected));
        skip(size, "metadata");
    }
}

}  // namespace bilayer::detail
