// SPDX-License-Identifier: Apache-2.0
// Reads scenes from formats without a native reader: glTF, and the formats of Assimp; internal.
#pragma once

#include <filesystem>

#include "sdf/io/child_process.h"
#include "sdf/io/polygon/polygons.h"

namespace bilayer::detail {

/// Reads a glTF file (.gltf, .glb: see readGltf()) or one of the formats of Assimp (see readByAssimp()).
///
/// Reading takes place in a child process (see ChildProcess), since the libraries may crash, hang or request any amount
/// of memory on damaged input. Throws std::runtime_error, in one line that names the file, if it cannot be read, or if
/// reading ended by a signal or exceeded `limits`. Exceptions of the C++ library, such as std::bad_alloc, are reported
/// in plain words.
Polygons readScene(const std::filesystem::path& path, const ChildLimits& limits);

/// Reads a scene with the limits for the file's size (see sceneLimits()).
Polygons readScene(const std::filesystem::path& path);

/// Returns 60 s plus 10 s per megabyte, and 2 GiB plus 100 bytes per byte.
ChildLimits sceneLimits(std::size_t fileSize);

}  // namespace bilayer::detail
