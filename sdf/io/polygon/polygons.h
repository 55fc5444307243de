// SPDX-License-Identifier: Apache-2.0
// The contents of a mesh file: polygons, before triangulation and welding; internal.
// Tested by tests/sdf/mesh_readers.cpp.
#pragma once

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <glm/vec3.hpp>
#include <string>
#include <utility>
#include <vector>

#include "sdf/base/parallel_parts.h"
#include "sdf/io/text_source.h"

namespace bilayer {
struct Mesh;
struct ReadReport;
}  // namespace bilayer

namespace bilayer::detail {

class MappedFile;

/// @tparam Scalar  float if the file has single precision only
template <class Scalar>
struct PolygonsOf {
    std::vector<glm::vec<3, Scalar>> points;  ///< vertex positions, as in the file or under its node transforms
    std::vector<unsigned> corners;            ///< indices into `points`, face by face
    std::vector<unsigned> sizes;     ///< count of corners of each face, in the same order; empty: each face has three
    std::vector<std::string> notes;  ///< what was omitted from the file and why, one sentence each
    std::vector<glm::uvec3> triangles{};  ///< indices into `points`: all faces, instead of `corners` and `sizes`
};
using Polygons = PolygonsOf<double>;

/// Faces of a part of a file.
struct Faces {
    std::vector<unsigned> corners, sizes;
    bool isOfTriangles = true;
    std::size_t small = 0;  ///< omitted faces with fewer than three corners

    /// Makes a face of the corners from `first` on.
    void close(std::size_t first) {
        const std::size_t size = corners.size() - first;
        if (size < 3) {
            corners.resize(first);
            ++small;
            return;
        }
        isOfTriangles &= size == 3;
        sizes.push_back(unsigned(size));
    }
};

/// Sets the faces of the polygons to those of all parts, in order. Adds notes about omitted faces.
template <class Scalar>
void setFaces(PolygonsOf<Scalar>& polygons, std::vector<Faces> parts);

/// A part of a text file, made of whole lines, and its contents.
struct TextPart {
    Cursor text;
    std::vector<glm::dvec3> points{};
    Faces faces{};
};

/// Moves the points of all parts into the polygons, in order.
/// @tparam Part  derives from TextPart
/// @return the index of the first point of each part, and the total count at the end
template <class Part>
std::vector<std::size_t> takePoints(Polygons& polygons, std::vector<Part>& parts) {
    std::vector<std::size_t> begins{0};
    for (const Part& part : parts) begins.push_back(begins.back() + part.points.size());
    polygons.points.resize(begins.back());
    inParallel(parts.size(), [&](std::size_t i) {
        std::copy(parts[i].points.begin(), parts[i].points.end(), polygons.points.begin() + std::ptrdiff_t(begins[i]));
        parts[i].points = {};
    });
    return begins;
}

/// Moves the faces of all parts into the polygons, in order.
template <class Part>
void takeFaces(Polygons& polygons, std::vector<Part>& parts) {
    std::vector<Faces> faces;
    for (Part& part : parts) faces.push_back(std::move(part.faces));
    setFaces(polygons, std::move(faces));
}

/// Largest relative error of a real number that is rounded to a float.
inline constexpr double floatRounding = 0x1p-24;

/// Returns whether floats may round coordinates of this magnitude by more than 1e-6 of the mesh's size. Such a mesh
/// gets its own origin.
/// @param farthest  largest magnitude of a coordinate [m]
/// @param size      longest side of the mesh's bounding box [m]
bool isTooFarForFloats(double farthest, double size);

/// Triangulates polygons, moves a distant mesh to a local origin, welds it, and reports what was done with the file's
/// contents. Throws std::runtime_error that names the file if no triangle is left, or if a face uses a vertex that does
/// not exist. Throws std::invalid_argument if a coordinate that a face uses is not finite.
template <class Scalar>
Mesh assembled(PolygonsOf<Scalar> polygons, const std::filesystem::path& path, ReadReport& report);

/// The same for the contents of a mapped file, which is unmapped first: the mesh then takes its memory.
template <class Scalar>
Mesh assembled(MappedFile& file, PolygonsOf<Scalar> polygons, const std::filesystem::path& path, ReadReport& report);

}  // namespace bilayer::detail
