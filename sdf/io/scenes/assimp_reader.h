// SPDX-License-Identifier: Apache-2.0
// Reads formats that have no reader of their own here, by Assimp; internal.
// Tested by tests/sdf/scene_io.cpp through readScene().
#pragma once

#include <filesystem>

#include "sdf/io/polygon/polygons.h"

struct aiScene;

namespace bilayer::detail {

/// Reads all meshes of a file under the transforms of their nodes, with untriangulated faces. Collada files keep their
/// own axes. Bones without a mesh add no surface. A scene without faces has a note of what it contains.
///
/// Throws std::runtime_error, which does not name the file, if Assimp does not know the extension, rejects the file, or
/// finds nothing in a ZIP64 archive. Other exceptions of Assimp pass through.
///
/// Many importers of Assimp 5.2 crash or hang on damaged files. Call this in a child process (see readScene()), which
/// also frees the memory that Assimp has allocated.
Polygons readByAssimp(const std::filesystem::path& path);

/// The same for a scene that Assimp has read, whose indices may be wrong.
Polygons polygonsOf(const aiScene& scene);

}  // namespace bilayer::detail
