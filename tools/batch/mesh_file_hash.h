// SPDX-License-Identifier: Apache-2.0
// The hash of a mesh file, the same on every machine.
// Tested by tests/tools/batch.cpp through run().
#pragma once

#include <cstdint>
#include <filesystem>

namespace bilayer::tools {

/// Returns the hash of a mesh file: of its bytes, and for a .gltf file also of the buffers that it refers to.
/// Throws std::runtime_error that names the file if it cannot be read.
std::uint64_t meshFileHash(const std::filesystem::path& path);

}  // namespace bilayer::tools
