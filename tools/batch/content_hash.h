// SPDX-License-Identifier: Apache-2.0
// Hashes of contents and names, the same on every machine.
// Tested by tests/tools/batch.cpp through run().
#pragma once

#include <cstdint>
#include <filesystem>
#include <string_view>

namespace bilayer::tools {

/// Returns a 64-bit hash of bytes. It is stable: records, shards and metadata of files depend on it.
std::uint64_t contentHash(std::string_view bytes);

/// Returns the hash of a mesh file: of its bytes, and for a .gltf file also of the buffers that it refers to.
/// Throws std::runtime_error that names the file if it cannot be read.
std::uint64_t meshFileHash(const std::filesystem::path& path);

}  // namespace bilayer::tools
