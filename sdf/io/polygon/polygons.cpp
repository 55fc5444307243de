// SPDX-License-Identifier: Apache-2.0
#include "sdf/io/polygon/polygons.h"

#include <fmt/format.h>
#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/parallel_reduce.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <optional>
#include <span>
#include <stdexcept>
#include <utility>

#include <bilayer/sdf/mesh.h>
#include <bilayer/sdf/mesh_io.h>
#include "sdf/base/finite.h"
#include "sdf/base/large_array.h"
#include "sdf/base/parallel_parts.h"
#include "sdf/base/welding.h"
#include "sdf/io/mapped_file.h"
#include "sdf/io/polygon/triangulate.h"
#include "sdf/io/text_source.h"

namespace bilayer::detail {
namespace {

constexpr std::size_t itemsPerTask = 1 << 14;  // vertices or faces per task
constexpr double maxRounding = 1e-6;           // of coordinates, relative to the size of the mesh

using IndexRange = tbb::blocked_range<std::size_t>;

/// Throws if a corner refers to a vertex that does not exist.
void requireVertices(const std::vector<unsigned>& corners, std::size_t vertices) {
    inParallel((corners.size() + itemsPerTask - 1) / itemsPerTask, [&](std::size_t part) {
        const std::size_t end = std::min((part + 1) * itemsPerTask, corners.size());
        for (std::size_t i = part * itemsPerTask; i < end; ++i)
            if (corners[i] >= vertices)
                throw std::runtime_error(
                    fmt::format("a face refers to vertex {}, but there are {}, counted from 0", corners[i], vertices));
    });
}

struct VertexBounds {
    glm::dvec3 lower{std::numeric_limits<double>::infinity()}, upper{-std::numeric_limits<double>::infinity()};
    std::size_t vertices = 0;  // count of vertices inside
};

/// Returns the bounding box of the used vertices.
template <class Scalar>
VertexBounds boundsOf(const std::vector<glm::vec<3, Scalar>>& points, const std::vector<std::uint8_t>& used) {
    return tbb::parallel_reduce(
        IndexRange(0, points.size(), itemsPerTask), VertexBounds{},
        [&](const IndexRange& range, VertexBounds bounds) {
            for (std::size_t i = range.begin(); i < range.end(); ++i) {
                if (!used[i]) continue;
                bounds.lower = glm::min(bounds.lower, glm::dvec3(points[i]));
                bounds.upper = glm::max(bounds.upper, glm::dvec3(points[i]));
                ++bounds.vertices;
            }
            return bounds;
        },
        [](const VertexBounds& a, const VertexBounds& b) {
            return VertexBounds{glm::min(a.lower, b.lower), glm::max(a.upper, b.upper), a.vertices + b.vertices};
        });
}

/// Returns the centre of a bounding box, rounded to so few digits that differences to nearby coordinates are exact;
/// zero for a mesh near zero.
glm::dvec3 originOf(const VertexBounds& bounds) {
    const glm::dvec3 size = bounds.upper - bounds.lower, far = glm::max(glm::abs(bounds.lower), glm::abs(bounds.upper));
    const double side = std::max({size.x, size.y, size.z}), farthest = std::max({far.x, far.y, far.z});
    if (!isTooFarForFloats(farthest, side)) return glm::dvec3(0);
    const double step = std::exp2(std::ceil(std::log2(side)));
    return step * glm::round(0.5 * (bounds.lower + bounds.upper) / step);
}

template <class Scalar>
std::vector<glm::vec3> relativeTo(const glm::dvec3& origin, std::vector<glm::vec<3, Scalar>> points) {
    if constexpr (std::is_same_v<Scalar, float>)
        if (origin == glm::dvec3(0)) return points;
    std::vector<glm::vec3> moved;
    resizeLarge(moved, points.size());
    tbb::parallel_for(IndexRange(0, points.size(), itemsPerTask), [&](const IndexRange& range) {
        for (std::size_t i = range.begin(); i < range.end(); ++i) moved[i] = glm::vec3(glm::dvec3(points[i]) - origin);
    });
    return moved;
}

/// A face whose triangles do not cover exactly what its outline encloses.
struct UncoveredFace {
    std::size_t index = 0;
    double enclosedArea = 0, triangleArea = 0;  // the outline's; the sum of the triangles'

    UncoveredFace() = default;
    UncoveredFace(std::size_t face, const std::vector<glm::dvec3>& outline, std::span<const glm::uvec3> triangles)
        : index(face) {
        glm::dvec3 sum(0);
        for (const glm::uvec3& t : triangles) {
            const glm::dvec3 area = 0.5 * glm::cross(outline[t.y] - outline[t.x], outline[t.z] - outline[t.x]);
            sum += area;
            triangleArea += glm::length(area);
        }
        enclosedArea = glm::length(sum);
    }
};

/// Triangles of some faces.
struct FaceTriangles {
    std::vector<glm::uvec3> triangles;
    std::size_t uncovered = 0;  // count of uncovered faces
    UncoveredFace firstUncovered;
};

/// Triangulates faces with any count of corners.
template <class Scalar>
class FaceTriangulator {
  public:
    explicit FaceTriangulator(const PolygonsOf<Scalar>& polygons) : polygons_(polygons) {
        begins_.reserve(parts() + 1);
        std::size_t corner = 0;
        for (std::size_t face = 0; face < polygons.sizes.size(); corner += polygons.sizes[face++])
            if (face % itemsPerTask == 0) begins_.push_back(corner);
    }

    std::vector<glm::uvec3> run(std::vector<std::string>& notes) const {
        std::vector<FaceTriangles> results(parts());
        inParallel(parts(), [&](std::size_t i) { results[i] = triangulatePart(i); });
        std::vector<std::size_t> begins{0};
        FaceTriangles all;
        for (const FaceTriangles& result : results) {
            begins.push_back(begins.back() + result.triangles.size());
            if (all.uncovered == 0) all.firstUncovered = result.firstUncovered;
            all.uncovered += result.uncovered;
        }
        if (all.uncovered > 0)
            notes.push_back(fmt::format(
                "the triangles of {} do not cover its outline, which crosses itself or encloses nothing; the "
                "first is face {}, counted from 0: the outline has the area {:.6g}, the triangles {:.6g}",
                counted(all.uncovered, "face", "faces"), all.firstUncovered.index, all.firstUncovered.enclosedArea,
                all.firstUncovered.triangleArea));
        all.triangles.resize(begins.back());
        inParallel(results.size(), [&](std::size_t i) {
            std::copy(results[i].triangles.begin(), results[i].triangles.end(),
                      all.triangles.begin() + std::ptrdiff_t(begins[i]));
        });
        return std::move(all.triangles);
    }

  private:
    std::size_t parts() const { return (polygons_.sizes.size() + itemsPerTask - 1) / itemsPerTask; }

    FaceTriangles triangulatePart(std::size_t part) const {
        FaceTriangles result;
        std::size_t corner = begins_[part];
        std::vector<glm::dvec3> outline;
        const std::size_t end = std::min((part + 1) * itemsPerTask, polygons_.sizes.size());
        for (std::size_t face = part * itemsPerTask; face < end; corner += polygons_.sizes[face++]) {
            const unsigned* corners = &polygons_.corners[corner];
            if (polygons_.sizes[face] == 3) {
                result.triangles.push_back({corners[0], corners[1], corners[2]});
                continue;
            }
            outline.clear();
            for (unsigned k = 0; k < polygons_.sizes[face]; ++k) outline.push_back(finitePoint(corners[k], face));
            const std::size_t first = result.triangles.size();
            if (!triangulate(outline, result.triangles) && result.uncovered++ == 0)
                result.firstUncovered = {face, outline, std::span(result.triangles).subspan(first)};
            for (std::size_t i = first; i < result.triangles.size(); ++i) {
                glm::uvec3& t = result.triangles[i];
                t = {corners[t.x], corners[t.y], corners[t.z]};
            }
        }
        return result;
    }

    glm::dvec3 finitePoint(unsigned index, std::size_t face) const {
        const glm::dvec3 point(polygons_.points[index]);
        if (!isFinite(point))
            throw std::invalid_argument(
                fmt::format("face {}, counted from 0, uses vertex {}, which is not finite: ({}, {}, {})", face, index,
                            point.x, point.y, point.z));
        return point;
    }

    const PolygonsOf<Scalar>& polygons_;
    std::vector<std::size_t> begins_;  // corners of each part's first face
};

std::vector<glm::uvec3> asTriangles(const std::vector<unsigned>& corners) {
    std::vector<glm::uvec3> triangles(corners.size() / 3);
    tbb::parallel_for(IndexRange(0, triangles.size(), itemsPerTask), [&](const IndexRange& range) {
        for (std::size_t i = range.begin(); i < range.end(); ++i)
            triangles[i] = {corners[3 * i], corners[3 * i + 1], corners[3 * i + 2]};
    });
    return triangles;
}

template <class Scalar>
std::vector<glm::uvec3> trianglesOf(PolygonsOf<Scalar>& polygons, std::vector<std::string>& notes) {
    if (!polygons.triangles.empty()) return std::move(polygons.triangles);
    if (polygons.sizes.empty()) return asTriangles(polygons.corners);
    requireVertices(polygons.corners, polygons.points.size());
    return FaceTriangulator(polygons).run(notes);
}

template <class Scalar>
std::size_t faceCount(const PolygonsOf<Scalar>& polygons) {
    if (!polygons.triangles.empty()) return polygons.triangles.size();
    return polygons.sizes.empty() ? polygons.corners.size() / 3 : polygons.sizes.size();
}

/// Sets the faces of all parts, which have three corners each.
/// @param begins  the first corner of each part among all; their count at the end
void setTriangles(std::vector<glm::uvec3>& triangles, std::vector<Faces>& parts,
                  const std::vector<std::size_t>& begins) {
    resizeLarge(triangles, begins.back() / 3);
    inParallel(parts.size(), [&](std::size_t i) {
        const std::vector<unsigned>& corners = parts[i].corners;
        glm::uvec3* to = triangles.data() + begins[i] / 3;
        for (std::size_t k = 0; k < corners.size(); k += 3) *to++ = {corners[k], corners[k + 1], corners[k + 2]};
        parts[i] = {};
    });
}

template <class Scalar>
Mesh meshOf(PolygonsOf<Scalar> polygons, ReadReport& report) {
    report.vertices = polygons.points.size();
    report.faces = faceCount(polygons);
    report.notes = std::move(polygons.notes);
    if (report.faces == 0)
        throw std::runtime_error(
            fmt::format("holds no triangle{}{}", report.notes.empty() ? "" : "; ", fmt::join(report.notes, "; ")));
    Mesh mesh;
    mesh.triangles = trianglesOf(polygons, report.notes);
    const VertexUse use = vertexUse(mesh.triangles, polygons.points.size());
    const VertexBounds bounds = boundsOf(polygons.points, use.used);
    report.unusedVertices = report.vertices - bounds.vertices;
    mesh.origin = originOf(bounds);
    mesh.points = relativeTo(mesh.origin, std::move(polygons.points));
    validate(mesh);
    const std::size_t triangles = mesh.triangles.size();
    mesh = weld(std::move(mesh), use);
    report.mergedVertices = bounds.vertices - mesh.points.size();
    report.collapsedTriangles = triangles - mesh.triangles.size();
    if (mesh.triangles.empty()) throw std::runtime_error("holds no triangle with three different corners");
    return mesh;
}

}  // namespace

bool isTooFarForFloats(double farthest, double size) {
    return size > 0 && std::isfinite(farthest) && farthest * floatRounding > maxRounding * size;
}

template <class Scalar>
void setFaces(PolygonsOf<Scalar>& polygons, std::vector<Faces> parts) {
    std::vector<std::size_t> corners{0}, sizes{0};
    bool isOfTriangles = true;
    std::size_t small = 0;
    for (const Faces& part : parts) {
        corners.push_back(corners.back() + part.corners.size());
        sizes.push_back(sizes.back() + part.sizes.size());
        isOfTriangles &= part.isOfTriangles;
        small += part.small;
    }
    if (isOfTriangles) {
        setTriangles(polygons.triangles, parts, corners);
    } else {
        polygons.corners.resize(corners.back());
        polygons.sizes.resize(sizes.back());
        inParallel(parts.size(), [&](std::size_t i) {
            std::copy(parts[i].corners.begin(), parts[i].corners.end(),
                      polygons.corners.begin() + std::ptrdiff_t(corners[i]));
            std::copy(parts[i].sizes.begin(), parts[i].sizes.end(), polygons.sizes.begin() + std::ptrdiff_t(sizes[i]));
            parts[i] = {};
        });
    }
    if (small > 0)
        polygons.notes.push_back(
            fmt::format("left out: {} with fewer than three corners", counted(small, "face", "faces")));
}

template <class Scalar>
Mesh assembled(PolygonsOf<Scalar> polygons, const std::filesystem::path& path, ReadReport& report) {
    try {
        return meshOf(std::move(polygons), report);
    } catch (const std::invalid_argument& error) {
        throw std::runtime_error(fmt::format("{}: {}", path.string(), error.what()));
    } catch (const std::runtime_error& error) {
        throw std::runtime_error(fmt::format("{}: {}", path.string(), error.what()));
    }
}

template <class Scalar>
Mesh assembled(MappedFile& file, PolygonsOf<Scalar> polygons, const std::filesystem::path& path, ReadReport& report) {
    file.unmap();
    return assembled(std::move(polygons), path, report);
}

template void setFaces(PolygonsOf<float>&, std::vector<Faces>);
template void setFaces(PolygonsOf<double>&, std::vector<Faces>);
template Mesh assembled(PolygonsOf<float>, const std::filesystem::path&, ReadReport&);
template Mesh assembled(PolygonsOf<double>, const std::filesystem::path&, ReadReport&);
template Mesh assembled(MappedFile&, PolygonsOf<float>, const std::filesystem::path&, ReadReport&);
template Mesh assembled(MappedFile&, PolygonsOf<double>, const std::filesystem::path&, ReadReport&);

}  // namespace bilayer::detail
