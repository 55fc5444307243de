// Every format that has no reader of its own here, by Assimp; internal.
#pragma once

#include <filesystem>

#include "sdf/io/polygons.h"

namespace bilayer::detail {

/// Reads all meshes of a file under the transforms of their nodes, with faces uncut. Collada files keep their own
/// axes. Bones without a mesh make no surface. Throws std::runtime_error, which does not name the file, when Assimp
/// does not know the ending or refuses the file, or finds nothing in a ZIP64 archive; whatever else Assimp throws
/// passes through. A scene without faces has a note of what it holds.
///
/// Many of Assimp 5.2's importers crash or hang on damaged files: call it in a child process (see readScene()), which
/// also frees what Assimp has allocated.
Polygons readByAssimp(const std::filesystem::path& path);

}  // namespace bilayer::detail
