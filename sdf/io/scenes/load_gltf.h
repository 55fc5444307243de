// SPDX-License-Identifier: Apache-2.0
// Loads a glTF file and the buffers that it refers to into tinygltf's model; internal.
// Tested by tests/sdf/read_gltf.cpp through readScene().
#pragma once

#include <filesystem>

#include "sdf/io/scenes/tinygltf.h"

namespace bilayer::detail {

/// Loads the parts of a glTF file that define its shape (see parseGltf()). Throws std::runtime_error, which does not
/// name the file, if the file violates the glTF 2 specification, requires an unsupported extension, or lacks a buffer.
/// Indices are not validated yet.
tinygltf::Model loadGltf(const std::filesystem::path& path);

}  // namespace bilayer::detail
