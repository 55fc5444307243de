// SPDX-License-Identifier: Apache-2.0
// One reader for each natively supported format; internal. Each throws std::runtime_error that names the file, the line
// or position, and the error. Files are read in parallel; the result does not depend on it.
// Tested by tests/sdf/mesh_readers.cpp through readMesh().
#pragma once

#include <filesystem>

#include <bilayer/sdf/mesh.h>
#include <bilayer/sdf/mesh_io.h>

namespace bilayer::detail {

/// Wavefront OBJ: `v` and `f`. Texture and normal indices are ignored; colours and weights are dropped.
Mesh readObj(const std::filesystem::path& path, ReadReport& report);

/// PLY (G. Turk, "The PLY Polygon File Format", 1994), text or binary in either byte order: elements `vertex`, `face`
/// and `tristrips` in any order.
Mesh readPly(const std::filesystem::path& path, ReadReport& report);

/// STL, text or binary. Size and contents determine which.
Mesh readStl(const std::filesystem::path& path, ReadReport& report);

/// OFF as Geomview writes it, three-dimensional and as text.
Mesh readOff(const std::filesystem::path& path, ReadReport& report);

/// RAW: a triangle of nine numbers per line, with a colour before them or a texture's name behind; names of objects.
/// Read sequentially.
Mesh readRaw(const std::filesystem::path& path, ReadReport& report);

}  // namespace bilayer::detail
