// SPDX-License-Identifier: Apache-2.0
// Elements of PLY files, read property by property: text, and binary records of any form; internal.
// Tested by tests/sdf/ply_reader.cpp through readMesh().
#pragma once

#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "sdf/io/formats/ply_binary.h"
#include "sdf/io/formats/ply_header.h"
#include "sdf/io/polygon/polygons.h"
#include "sdf/io/text_source.h"

namespace bilayer::detail {

/// How the records of a text are separated: by the ends of their lines, or not at all, as a sequence of words.
enum class PlyTextLayout { lines, words };

/// Throws std::runtime_error with the count of records that are there, if the data ends before the last one.
void requirePlyElements(const PlyHeader& header, const PlyElement& element, const TextSource& source, Cursor text,
                        PlyTextLayout layout);
void requirePlyElements(const PlyHeader& header, const PlyElement& element, PlyData data);

/// Reads all records of an element, and advances past them. Throws std::runtime_error that names the file and what is
/// wrong in it.
/// @param points  of the file; vertices are written to it
/// @return the faces, in order; none for other elements
std::vector<Faces> readPlyElements(const PlyHeader& header, const PlyElement& element, const TextSource& source,
                                   Cursor& text, PlyTextLayout layout, std::span<glm::dvec3> points);
template <class Scalar>
std::vector<Faces> readPlyElements(const PlyHeader& header, const PlyElement& element, PlyData& data,
                                   std::span<glm::vec<3, Scalar>> points);

}  // namespace bilayer::detail
