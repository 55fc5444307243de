// Meshes from and to files, by Assimp.
#pragma once

#include <filesystem>

#include "sdf/mesh.h"

namespace bilayer {

/// Reads a mesh: OBJ, PLY, STL, OFF, glTF and whatever else Assimp knows. All meshes of the file's scene are joined
/// under their node transforms, polygons are cut into triangles, and the result is welded (see weld()). Throws
/// std::runtime_error that names the file when it cannot be read or holds no triangle, and std::invalid_argument when
/// its coordinates are not finite.
Mesh readMesh(const std::filesystem::path& path);

/// Writes a mesh as .obj, .ply or .stl (the two latter binary), whole or not at all.
/// Throws std::invalid_argument for another ending, std::runtime_error that names the file when it cannot be written.
void writeMesh(const std::filesystem::path& path, const Mesh& mesh);

}  // namespace bilayer
