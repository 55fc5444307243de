// A glTF file and the buffers that it refers to, as tinygltf's model; internal.
#pragma once

#include <filesystem>

#include "sdf/tinygltf.h"

namespace bilayer {

/// Throws std::runtime_error, which does not name the file: it is no glTF 2, asks for an extension that is not
/// understood, or refers to a buffer that is no regular file in its folder. Indices are not checked yet.
tinygltf::Model loadGltf(const std::filesystem::path& path);

}  // namespace bilayer
