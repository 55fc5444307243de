// SPDX-License-Identifier: Apache-2.0
// Files of surface blocks: what the tiles of a field must know of each other for distance bounds.
// Tested by tests/tools/tiled_field.cpp through TiledField.
#pragma once

#include <filesystem>
#include <span>
#include <vector>

#include "collider/field/layout/field_layout.h"

namespace bilayer::detail {

/// Writes the blocks as 32-bit numbers in the processor's order: three coordinates and the bits of the coarse cells.
/// Throws std::runtime_error that names the file.
void writeSurfaceBlocks(const std::filesystem::path& path, std::span<const SurfaceBlock> blocks);

/// Appends the blocks of a file. Throws std::runtime_error that names the file.
void readSurfaceBlocks(const std::filesystem::path& path, std::vector<SurfaceBlock>& blocks);

}  // namespace bilayer::detail
