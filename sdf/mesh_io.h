// SPDX-License-Identifier: Apache-2.0
// Mesh files.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include <bilayer/sdf/mesh.h>

namespace bilayer {

/// The contents of a mesh file, and what readMesh() removed.
struct ReadReport {
    std::size_t vertices = 0;            ///< in the file
    std::size_t faces = 0;               ///< in the file
    std::size_t mergedVertices = 0;      ///< merged into another vertex with the same position
    std::size_t unusedVertices = 0;      ///< removed: no face uses them
    std::size_t collapsedTriangles = 0;  ///< removed: two corners coincide
    /// What else was removed and why, one sentence per entry without a full stop. Also lists faces whose outline
    /// crosses itself, and coordinates that Assimp has rounded by more than 1e-6 of the mesh's size.
    std::vector<std::string> notes;
};

/// A mesh and what its file contains.
struct MeshFile {
    Mesh mesh;          ///< the triangles of the file
    ReadReport report;  ///< what the file held, and what was left out
};

/// Reads a mesh from OBJ, PLY, STL, OFF, RAW, glTF or any other format that Assimp supports. The file extension selects
/// the format.
///
/// Joins all meshes of the scene under their node transforms, triangulates polygons and welds the result (see weld()).
/// Coordinates are read in double precision; Assimp has single precision. A mesh so far from the world origin that
/// floats would round its coordinates by more than 1e-6 of its size is moved near to it, and Mesh::origin stores the
/// shift. That is so from 16.8 times its size on.
///
/// Throws std::runtime_error if the file cannot be read, holds no triangle, or has a face with a coordinate that is not
/// finite. The error names the file and, where known, the line and its text.
Mesh readMesh(const std::filesystem::path& path);
/// The same, with a report of what the file held and what was left out.
MeshFile readMeshFile(const std::filesystem::path& path);

/// Writes a mesh in world coordinates as .obj, binary .ply or binary .stl. An error leaves no partial file. Coordinates
/// are floats. A mesh with an origin has doubles in .obj and .ply, and rounded floats in .stl.
/// Throws std::invalid_argument for another extension, and std::runtime_error that names the file if it cannot be
/// written.
void writeMesh(const std::filesystem::path& path, const Mesh& mesh);

}  // namespace bilayer
