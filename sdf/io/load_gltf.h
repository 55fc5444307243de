// A glTF file and the buffers that it refers to, as tinygltf's model; internal.
#pragma once

#include <filesystem>

#include "sdf/io/tinygltf.h"

namespace bilayer::detail {

/// The parts of a glTF file that make its shape (see parseGltf()). Throws std::runtime_error, which does not name the
/// file, if it is not as glTF 2 says, asks for an extension that is not understood, or lacks a buffer. Indices are not
/// checked yet.
tinygltf::Model loadGltf(const std::filesystem::path& path);

}  // namespace bilayer::detail
