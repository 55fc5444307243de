// SPDX-License-Identifier: Apache-2.0
// Elements of PLY files, read property by property: text, and binary records of any form; internal.
// Tested by tests/sdf/ply_reader.cpp.
#pragma once

#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "sdf/io/ply_binary.h"
#include "sdf/io/ply_header.h"
#include "sdf/io/polygons.h"
#include "sdf/io/text_source.h"

namespace bilayer::detail {

/// Reads all records of an element, and advances past them. Throws std::runtime_error that names the file and what is
/// wrong in it.
/// @param points  of the file; vertices are written to it
/// @return the faces, in order; none for other elements
std::vector<Faces> readPlyElements(const PlyHeader& header, const PlyElement& element, const TextSource& source,
                                   Cursor& text, std::span<glm::dvec3> points);
template <class Scalar>
std::vector<Faces> readPlyElements(const PlyHeader& header, const PlyElement& element, PlyData& data,
                                   std::span<glm::vec<3, Scalar>> points);

}  // namespace bilayer::detail
