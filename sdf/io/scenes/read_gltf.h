// SPDX-License-Identifier: Apache-2.0
// Reads glTF 2.0, as text (.gltf) and binary (.glb), by tinygltf; internal.
#pragma once

#include <filesystem>

#include "sdf/io/polygon/polygons.h"

namespace bilayer::detail {

/// Reads the triangles of the default scene in double precision. If there is no default scene it reads the first one;
/// if there is no scene it reads all nodes. Supports KHR_mesh_quantization, EXT_mesh_gpu_instancing, sparse accessors,
/// all triangle topologies, and skins in the pose of their nodes. Rotations are normalised. Points, lines, morph
/// targets, and nodes outside of the scene are omitted with a note; images are not read. A scene without triangles has
/// a note of what it contains.
///
/// Throws std::runtime_error, which does not name the file, if the file requires an unsupported extension or violates
/// the specification. tinygltf 2.7 validates only part of its input: call this in a child process (see readScene()).
Polygons readGltf(const std::filesystem::path& path);

}  // namespace bilayer::detail
