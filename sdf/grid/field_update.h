// SPDX-License-Identifier: Apache-2.0
// Updates the field of a mesh after some of its triangles have moved.
// Tested by tests/sdf/rebuild.cpp.
#pragma once

#include <cstdint>
#include <span>

#include <bilayer/sdf/level_set.h>
#include <bilayer/sdf/mesh.h>

namespace bilayer::detail {

class FieldFiller;

/// Fills only the blocks within reach of moved triangles, and copies the others from an old field. Returns false if the
/// whole field must be filled instead, as rebuild() documents.
/// @param oldMesh  the mesh of the old field
/// @param moved    triangles of the filler's mesh that may have moved
/// Throws as rebuild() does.
bool updateField(FieldFiller& filler, const LevelSet& old, const Mesh& oldMesh, std::span<const std::uint32_t> moved);

}  // namespace bilayer::detail
