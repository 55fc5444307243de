// SPDX-License-Identifier: Apache-2.0
// Reads and writes fields as .vdb files, which Houdini, Blender and ParaView also open.
#pragma once

#include <filesystem>

#include <bilayer/sdf/level_set.h>

namespace bilayer {

/// Options of writeVdb().
struct VdbOptions {
    bool halfFloat = false;  ///< store distances as 16-bit floats: half the size, 3 significant decimal digits
};

/// Returns the LevelSet::errorBound() of a field after writing and reading it with these options, rounding included
/// [m].
float storedErrorBound(const LevelSet& levelSet, const VdbOptions& options);

/// Writes the grids "distance" and, if present, "triangle" and "contact_points". An error leaves no partial file: a
/// temporary file next to the target is renamed at the end. A checksum follows the grids, and OpenVDB ignores it.
/// Throws std::runtime_error that names the file if it cannot be written.
void writeVdb(const std::filesystem::path& path, const LevelSet& levelSet, const VdbOptions& options = {});

/// Reads the first level set of a .vdb file from bilayer or another program. Also reads the grids of triangles and of
/// surface points if present. Checks all lengths in the file before use, so memory stays in proportion to the file
/// size.
/// Throws std::runtime_error that names the file if it:
/// - cannot be read, or is truncated;
/// - does not match its checksum;
/// - holds no level set;
/// - holds a level set with metadata or a distance out of range.
LevelSet readVdb(const std::filesystem::path& path);

}  // namespace bilayer
