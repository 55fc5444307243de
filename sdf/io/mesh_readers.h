// One reader for each format that is read here; internal. Each throws std::runtime_error that names the file, the line
// or the place, and what is wrong. The files are read in parallel; what comes out does not depend on it.
#pragma once

#include <filesystem>

#include <bilayer/sdf/mesh.h>
#include <bilayer/sdf/mesh_io.h>

namespace bilayer::detail {

/// Wavefront OBJ: `v` and `f`. Texture and normal indices are not looked at, colours and weights not kept.
Mesh readObj(const std::filesystem::path& path, ReadReport& report);

/// PLY (G. Turk, "The PLY Polygon File Format", 1994), text or binary of either byte order: elements `vertex`, `face`
/// and `tristrips` in any order.
Mesh readPly(const std::filesystem::path& path, ReadReport& report);

/// STL, text or binary: size and contents decide.
Mesh readStl(const std::filesystem::path& path, ReadReport& report);

/// OFF as Geomview writes it, in three dimensions and as text.
Mesh readOff(const std::filesystem::path& path, ReadReport& report);

}  // namespace bilayer::detail
