// SPDX-License-Identifier: Apache-2.0
// Elements of binary PLY files whose records all have the same length: read in parallel at known offsets; internal.
// Tested by tests/sdf/ply_reader.cpp through readMesh().
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <optional>
#include <span>
#include <vector>

#include "sdf/io/formats/ply_binary.h"
#include "sdf/io/formats/ply_header.h"

namespace bilayer::detail {

/// Vertices without lists whose coordinates all have the same type: records of one size.
struct PlyVertexRecords {
    PlyType type;
    std::size_t size, offsets[3];  ///< size of a record, and offset of each coordinate [bytes]

    /// Returns nothing for an element of another kind.
    static std::optional<PlyVertexRecords> of(const PlyElement& element);

    /// Reads points from consecutive records. Returns false if a coordinate is not a finite float.
    template <class Point>
    bool read(const char* at, bool swapped, std::span<Point> points) const;
};

/// Faces that are mostly triangles: one byte for the count of corners, four bytes per corner, and no other list.
struct PlyTriangleRecords {
    std::uint64_t vertices;
    std::size_t size, offset;  ///< size of a record, and offset of its list [bytes]

    /// Returns nothing for an element of another kind.
    static std::optional<PlyTriangleRecords> of(const PlyElement& element, std::uint64_t vertices);

    bool isTriangle(const char* record) const { return record[offset] == 3; }

    /// Reads triangles from consecutive records. Returns false if a face is not a triangle or a corner is not a vertex.
    bool read(const char* at, bool swapped, std::span<glm::uvec3> triangles) const;
};

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
