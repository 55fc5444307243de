// SPDX-License-Identifier: Apache-2.0
// Hashes of contents and names, the same on every machine.
// Tested by tests/tools/batch.cpp through the program.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

namespace bilayer::detail {

/// Returns a 64-bit hash of bytes. It is stable: records, shards and metadata of files depend on it.
std::uint64_t contentHash(std::string_view bytes);

/// Returns a hash of a file's bytes as 16 hexadecimal digits. Only some of the bytes are in memory at once. Throws
/// std::runtime_error that names the file.
std::string fileHash(const std::filesystem::path& path);

}  // namespace bilayer::detail
