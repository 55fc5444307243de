// Fields from and to .vdb files, which Houdini, Blender and ParaView open too.
#pragma once

#include <filesystem>

#include <bilayer/sdf/level_set.h>

namespace bilayer {

struct VdbOptions {
    bool halfFloat = false;  ///< store distances as 16-bit floats: half the size, 3 decimal digits
};

/// LevelSet::errorBound() of the field that a file with these options gives back: rounding included [m].
float storedErrorBound(const LevelSet& levelSet, const VdbOptions& options);

/// Writes the grids "distance" and, where present, "triangle" and a body's "contact_points": whole or not at all (a
/// temporary file beside the target is renamed at the end), and a checksum behind them, which OpenVDB passes over.
/// Throws std::runtime_error that names the file when it cannot be written.
void writeVdb(const std::filesystem::path& path, const LevelSet& levelSet, const VdbOptions& options = {});

/// Reads the first level set of a .vdb file, from bilayer or elsewhere, with its grids of triangles and of a body's
/// points if it has them.
/// Throws std::runtime_error that names the file when it cannot be read, is truncated, is not what its checksum says
/// that was written, or holds no level set, or one with an entry or a distance beyond its range. It takes no more
/// memory than the file's size explains: lengths in it are checked before they are used.
LevelSet readVdb(const std::filesystem::path& path);

}  // namespace bilayer
