// What a mesh file holds: polygons, before they are cut into triangles and their vertices welded; internal.
#pragma once

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <glm/vec3.hpp>
#include <string>
#include <vector>

#include "sdf/base/parallel_parts.h"

namespace bilayer {
struct Mesh;
struct ReadReport;
}  // namespace bilayer

namespace bilayer::detail {

/// @tparam Scalar  float where the file holds no better
template <class Scalar>
struct PolygonsOf {
    std::vector<glm::vec<3, Scalar>> points;  ///< vertex positions, as the file has them or under its node transforms
    std::vector<unsigned> corners;            ///< indices into `points`, of one face after the other
    std::vector<unsigned> sizes;              ///< corners of each face, in the same order; empty: each has three
    std::vector<std::string> notes;           ///< what of the file was left out and why, a sentence each
    std::vector<glm::uvec3> triangles{};      ///< indices into `points`: all faces, instead of `corners` and `sizes`
};
using Polygons = PolygonsOf<double>;

/// Faces of a part of a file.
struct Faces {
    std::vector<unsigned> corners, sizes;
    bool isOfTriangles = true;
    std::size_t small = 0;  ///< left out, since they have fewer than three corners

    /// The corners from `first` on are a face.
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

/// The faces of all parts, in their order, as those of the polygons. Tells in their notes of those that were left out.
template <class Scalar>
void setFaces(PolygonsOf<Scalar>& polygons, const std::vector<Faces>& parts);

/// The points of all parts, in their order, as those of the polygons.
/// @tparam Part  has `points`, a vector of glm::dvec3
/// @return where those of each part begin, and how many there are at the end
template <class Part>
std::vector<std::size_t> setPoints(Polygons& polygons, const std::vector<Part>& parts) {
    std::vector<std::size_t> begins{0};
    for (const Part& part : parts) begins.push_back(begins.back() + part.points.size());
    polygons.points.resize(begins.back());
    inOrder(parts.size(), [&](std::size_t i) {
        std::copy(parts[i].points.begin(), parts[i].points.end(), polygons.points.begin() + std::ptrdiff_t(begins[i]));
    });
    return begins;
}

/// Cuts polygons into triangles, moves a mesh that is far away to an origin of its own, welds it, and tells what became
/// of the file's contents. Throws std::runtime_error that names the file if no triangle is left, or if a face uses a
/// vertex that is not there, and std::invalid_argument if a coordinate that a face uses is not finite.
template <class Scalar>
Mesh assembled(PolygonsOf<Scalar> polygons, const std::filesystem::path& path, ReadReport& report);

}  // namespace bilayer::detail
