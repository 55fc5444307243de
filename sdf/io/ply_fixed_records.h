// SPDX-License-Identifier: Apache-2.0
// Elements of binary PLY files whose records all have the same length: read in parallel at known offsets; internal.
// Tested by tests/sdf/ply_reader.cpp.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include "sdf/io/ply_binary.h"
#include "sdf/io/ply_header.h"

namespace bilayer::detail {

/// Reads vertices without lists whose coordinates all have the same type. Returns false if they are of another kind, or
/// if a coordinate is not a finite float or the data is too short; `data` is then unchanged.
/// @param points  one for each vertex
template <class Scalar>
bool readFixedVertices(const PlyElement& element, PlyData& data, std::vector<glm::vec<3, Scalar>>& points);

/// Reads faces that are all triangles, with one byte for the count of corners, four bytes per corner, and no other
/// list. Returns false if they are of another kind, or if a corner is not a vertex or the data is too short; `data` is
/// then unchanged, and `triangles` is empty.
/// @param vertices  count of vertices
bool readFixedTriangles(const PlyElement& element, std::uint64_t vertices, PlyData& data,
                        std::vector<glm::uvec3>& triangles);

}  // namespace bilayer::detail
