// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <glm/geometric.hpp>
#include <stdexcept>
#include <string>
#include <tuple>

#include <bilayer/sdf/build.h>
#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/inspect.h>
#include "sdf/base/openvdb.h"
#include "tests/fuzz/byte_source.h"
#include "tests/fuzz/checks.h"
#include "tests/fuzz/mesh_recipe.h"
#include "tests/support/truth.h"
#include "tests/support/verdict.h"

namespace bilayer::test {
namespace {

constexpr std::size_t voxelsPerField = 400;  // that are compared with the ground truth
constexpr unsigned maxResolution = 20;       // voxels along the longest side

bool isSolid(const MeshReport& report) {
    return report.closed() && report.oriented() && report.selfIntersections == 0 && report.nonManifoldVertices == 0 &&
           report.degenerateTriangles == 0 && report.duplicateTriangles == 0;
}

std::string text(const Verdict& verdict) {
    std::string all = fmt::format("inexact {}, wrong signs {}, background {}, missing {}, extra {}", verdict.inexact,
                                  verdict.wrong, verdict.wrongBackground, verdict.missing, verdict.extra);
    for (const Witness& witness : verdict.witnesses) all += "; " + witness.text();
    return all;
}

/// @param isJudged  whether signs are compared with winding numbers
void requireTrue(const LevelSet& field, const Mesh& mesh, const Band& band, bool isJudged, const char* name) {
    const openvdb::FloatGrid& grid = *field.grids().distance;
    const auto voxels = trueVoxels(Truth(mesh), chooseVoxels(grid, mesh, band, voxelsPerField, 1), grid.voxelSize()[0]);
    const Verdict verdict = judge(grid, band, voxels, isJudged ? Signs::judged : Signs::ignored);
    require(verdict.exact(), fmt::format("{} field, signs by {}: {}", name, field.sign(), text(verdict)));
}

/// Compares the counts of a report with counts over all edges.
void requireCounts(const MeshReport& report, const Mesh& mesh) {
    const Mesh welded = weld(mesh);
    std::vector<std::pair<unsigned, unsigned>> edges;
    for (const glm::uvec3& t : welded.triangles)
        for (int k = 0; k < 3; ++k) edges.push_back(std::minmax(t[k], t[(k + 1) % 3]));
    std::sort(edges.begin(), edges.end());
    std::size_t boundary = 0, nonManifold = 0;
    for (std::size_t begin = 0, end = 0; begin < edges.size(); begin = end) {
        while (end < edges.size() && edges[end] == edges[begin]) ++end;
        boundary += end - begin == 1;
        nonManifold += end - begin > 2;
    }
    require(report.boundaryEdges == boundary && report.nonManifoldEdges == nonManifold,
            fmt::format("inspect() counts {} boundary and {} non-manifold edges, and there are {} and {}",
                        report.boundaryEdges, report.nonManifoldEdges, boundary, nonManifold));
}

/// The mesh with its points and triangles in reverse order.
Mesh reversed(const Mesh& mesh) {
    Mesh result = mesh;
    std::reverse(result.points.begin(), result.points.end());
    std::reverse(result.triangles.begin(), result.triangles.end());
    const unsigned last = unsigned(mesh.points.size()) - 1;
    for (glm::uvec3& t : result.triangles) t = last - t;
    return result;
}

/// What a report counts, for all orders of points and triangles.
auto countsOf(const MeshReport& r) {
    return std::tuple(r.points, r.triangles, r.components, r.boundaryEdges, r.nonManifoldEdges, r.misorientedEdges,
                      r.degenerateTriangles, r.duplicateTriangles, r.boundaryLoops, r.nonManifoldVertices,
                      r.selfIntersections);
}

bool hasArea(const Mesh& mesh) {
    return std::any_of(mesh.triangles.begin(), mesh.triangles.end(), [&](const glm::uvec3& t) {
        const glm::dvec3 a(mesh.points[t.x]), b(mesh.points[t.y]), c(mesh.points[t.z]);
        return glm::length(glm::cross(b - a, c - a)) > 0;
    });
}

void checkField(const Mesh& mesh, BuildOptions options) {
    const MeshReport report = inspect(mesh, options.voxelSize);
    (void)verdict(report);
    requireCounts(report, mesh);
    const LevelSet exact = build(mesh, options);
    const Band band{options.exteriorWidthVoxels, options.interiorWidthVoxels};
    const bool isJudged = isSolid(report) && options.sign != Sign::flood;
    if (options.unite && !isJudged) return;  // walls inside are left out
    requireTrue(exact, mesh, band, isJudged, "exact");
    options.method = Method::pseudonormal;
    requireTrue(build(mesh, options), mesh, band, isJudged, "pseudonormal");
}

}  // namespace

void checkInspect(Bytes recipe) {
    ByteSource bytes(recipe);
    const Mesh mesh = meshOf(bytes);
    const float wall = std::abs(bytes.lattice());
    try {
        const MeshReport report = inspect(mesh, wall);
        requirePlainError(verdict(report));
        requireCounts(report, mesh);
        const MeshReport other = inspect(reversed(mesh), wall);
        require(countsOf(other) == countsOf(report),
                "another order of the mesh has another report: " + verdict(report) + "; " + verdict(other));
        require(report.thinWalls <= report.triangles && report.flippedTriangles <= report.triangles,
                "a report counts more triangles than there are");
    } catch (const std::invalid_argument& error) {
        requirePlainError(error.what());
    }
}

void checkBuild(Bytes recipe) {
    ByteSource bytes(recipe);
    const Mesh mesh = meshOf(bytes);
    const float widths[] = {0.6f, 1, 3, 2.25f, 5};
    constexpr float minVoxel = 2e-5f;  // that build() accepts [m]
    BuildOptions options{.voxelSize =
                             std::max(minVoxel, bounds(mesh).longestSide() / float(1 + bytes.below(maxResolution)))};
    options.exteriorWidthVoxels = options.interiorWidthVoxels = widths[bytes.below(std::size(widths))];
    const Sign signs[] = {Sign::automatic, Sign::normals, Sign::winding, Sign::flood};
    options.sign = signs[bytes.below(std::size(signs))];
    options.triangles = bytes.flag();
    options.unite = bytes.byte() % 4 == 0 && options.sign != Sign::flood;
    try {
        checkField(mesh, options);
    } catch (const std::invalid_argument& error) {
        requirePlainError(error.what());
        require(!hasArea(mesh), std::string("a mesh with an area is refused: ") + error.what());
    }
}

}  // namespace bilayer::test
