// SPDX-License-Identifier: Apache-2.0
// What is known of a mesh file before it is read: the hash of its contents, and the memory that reading it takes.
// Tested by tests/tools/batch.cpp and tiles.cpp through the program.
#pragma once

#include <cstdint>
#include <filesystem>

namespace bilayer::tools {

/// Returns the hash of a mesh file, the same on every machine: of its bytes, and for a .gltf file also of the buffers
/// that it refers to. Throws std::runtime_error that names the file if it cannot be read.
std::uint64_t meshFileHash(const std::filesystem::path& path);

/// Returns an estimate of the memory that reading a mesh file whole takes, with the program [bytes]. Throws
/// std::runtime_error that names the file if it cannot be read.
double bytesToRead(const std::filesystem::path& path);

}  // namespace bilayer::tools
