// SPDX-License-Identifier: Apache-2.0
// Binary files with a hash of their bytes, for what tiles of a field exchange. The numbers are in the processor's
// order.
//
// Tested by tests/sdf/tile_flood_signs.cpp.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

namespace bilayer::detail {

/// Returns check(), or false if it throws std::runtime_error: a file that it reads is missing or damaged.
template <class Check>
bool passes(const Check& check) {
    try {
        return check();
    } catch (const std::runtime_error&) {
        return false;
    }
}

/// Collects values, and writes them as one file.
class HashedRecordWriter {
  public:
    template <class Value>
    void add(const Value& value) {
        static_assert(std::is_trivially_copyable_v<Value>);
        bytes_.append(reinterpret_cast<const char*>(&value), sizeof value);
    }

    template <class Value>
    void add(const std::vector<Value>& values) {
        static_assert(std::is_trivially_copyable_v<Value>);
        add(std::uint64_t(values.size()));
        bytes_.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(Value));
    }

    /// Writes the file whole or not at all. Throws std::runtime_error that names it.
    void write(const std::filesystem::path& path) const;

  private:
    std::string bytes_;
};

/// Returns the values of a file in the order in which they were added.
class HashedRecordReader {
  public:
    /// Throws std::runtime_error that names the file if it cannot be read or its bytes do not have their hash.
    explicit HashedRecordReader(const std::filesystem::path& path);

    template <class Value>
    Value value() {
        Value value;
        take(&value, sizeof value);
        return value;
    }

    template <class Value>
    std::vector<Value> values() {
        const auto count = value<std::uint64_t>();
        if (count > (bytes_.size() - at_) / sizeof(Value)) fail();
        std::vector<Value> values(static_cast<std::size_t>(count));
        take(values.data(), values.size() * sizeof(Value));
        return values;
    }

    std::size_t size() const { return bytes_.size(); }  ///< [bytes]

    /// Throws std::runtime_error that names the file as damaged: values do not fit together.
    [[noreturn]] void fail() const;

  private:
    void take(void* to, std::size_t bytes) {
        if (bytes > bytes_.size() - at_) fail();
        if (bytes > 0) std::memcpy(to, bytes_.data() + at_, bytes);
        at_ += bytes;
    }

    std::filesystem::path path_;
    std::string bytes_;
    std::size_t at_ = 0;
};

}  // namespace bilayer::detail
