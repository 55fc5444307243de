// glTF 2.0, as text (.gltf) and binary (.glb), by tinygltf; internal.
#pragma once

#include <filesystem>

#include "sdf/io/polygons.h"

namespace bilayer::detail {

/// Reads the triangles of the default scene (or the first one, or all nodes where there is no scene) in double
/// precision. Understands KHR_mesh_quantization, EXT_mesh_gpu_instancing, sparse accessors, all ways to make triangles,
/// and skins in the pose of their nodes. Rotations are normalised. Points, lines, morph targets, and nodes outside of
/// the scene are left out with a note; images are not read. A scene without triangles has a note of what it holds.
///
/// Throws std::runtime_error, which does not name the file, if it asks for an extension that is not understood, or is
/// not as glTF says. tinygltf 2.7 checks only part of what it reads: call it in a child process (see readScene()).
Polygons readGltf(const std::filesystem::path& path);

}  // namespace bilayer::detail
