// Scenes from files that have no fast reader here: glTF, and whatever Assimp knows; internal.
#pragma once

#include <filesystem>

#include "sdf/io/child_process.h"
#include "sdf/io/polygons.h"

namespace bilayer::detail {

/// Reads a glTF file (.gltf, .glb: see readGltf()) or one of the formats of Assimp (see readByAssimp()).
///
/// It is read in a child process (see ChildProcess), since its library may crash, hang or ask for any amount of memory
/// on damaged input. Throws std::runtime_error, in one line that names the file: it cannot be read, or reading ended by
/// a signal or beyond `limits`. An exception of the C++ library, as std::bad_alloc, is told in plain words.
Polygons readScene(const std::filesystem::path& path, const ChildLimits& limits);

/// By the limits that the file's size asks for (see sceneLimits()).
Polygons readScene(const std::filesystem::path& path);

/// 60 s and 10 s more for each megabyte; 2 GiB and 100 bytes more for each byte.
ChildLimits sceneLimits(std::size_t fileSize);

}  // namespace bilayer::detail
