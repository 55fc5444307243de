// SPDX-License-Identifier: Apache-2.0
// A .vdb file as a stream whose lengths are checked before they are used; internal.
// Tested by tests/sdf/vdb_io.cpp through readVdb().
#pragma once

#include <cstdint>
#include <istream>
#include <string>

namespace bilayer::detail {

/// LZ4 writes at least one byte for this count of bytes, which limits the decompressed size.
inline constexpr std::uint64_t maxLz4Expansion = 256;

/// Reads what lengths depend on, and skips the rest. Throws std::runtime_error for a length beyond the end, and
/// std::ios_base::failure if the stream ends too soon and has such exceptions enabled.
class VdbStream {
  public:
    /// @param size  of the stream, from its current position [bytes]
    VdbStream(std::istream& in, std::uint64_t size) : in_(in), left_(size) {}

    /// Returns how much is left [bytes].
    std::uint64_t left() const { return left_; }

    /// Throws unless this length is left.
    /// @param what  "a name"
    void require(std::uint64_t length, const char* what) const {
        if (length > left_) failLength(length, what);
    }

    template <class Value>
    Value read() {
        Value value;
        read(&value, sizeof value);
        return value;
    }
    void read(void* to, std::uint64_t size);

    void skip(std::uint64_t length, const char* what);

    std::string readName();
    void skipName() { skip(read<std::uint32_t>(), "a name"); }

    /// Skips bytes compressed by Blosc, which are `expected` decompressed bytes.
    void skipBlosc(std::uint64_t length, std::uint64_t expected);

    /// Skips the metadata of a grid, or of something else.
    void skipMetadata();

  private:
    void skipDelayedLoad(std::uint64_t size);
    [[noreturn]] void failLength(std::uint64_t length, const char* what) const;

    std::istream& in_;
    std::uint64_t left_;
};

}  // namespace bilayer::detail
