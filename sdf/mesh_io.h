// Meshes from and to files.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include <bilayer/sdf/mesh.h>

namespace bilayer {

/// What a mesh file held, and what became of it.
struct ReadReport {
    std::size_t vertices = 0;            ///< in the file
    std::size_t faces = 0;               ///< in the file
    std::size_t mergedVertices = 0;      ///< at the place of another vertex, which stands for them
    std::size_t unusedVertices = 0;      ///< left out: no face uses them
    std::size_t collapsedTriangles = 0;  ///< left out: two corners are in one place
    /// What else was left out and why, a sentence each without a full stop; faces whose outline crosses itself too.
    std::vector<std::string> notes;
};

/// Reads a mesh: OBJ, PLY, STL, OFF, glTF and whatever else Assimp knows; the ending says which. All meshes of the
/// file's scene are joined under their node transforms, polygons are cut into triangles, and the result is welded (see
/// weld()). Coordinates are read in double precision. A mesh that is farther from the zero point than a thousand times
/// its size is moved near to it, and Mesh::origin says by how much.
/// @param report  if not null, receives what the file held
/// Throws std::runtime_error that names the file, and where the reader knows it the line and what stands there, when it
/// cannot be read or holds no triangle, and std::invalid_argument when its coordinates are not finite.
Mesh readMesh(const std::filesystem::path& path, ReadReport* report = nullptr);

/// Writes a mesh in world coordinates as .obj, .ply or .stl (the two latter binary), whole or not at all.
/// Coordinates are floats; those of a mesh with an origin are doubles in .obj and .ply, and are rounded in .stl.
/// Throws std::invalid_argument for another ending, std::runtime_error that names the file when it cannot be written.
void writeMesh(const std::filesystem::path& path, const Mesh& mesh);

}  // namespace bilayer
