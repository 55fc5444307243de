// SPDX-License-Identifier: Apache-2.0
// Construction of mesh trees, and the closest features of triangles in double precision.
#include "collider/field/triangles/mesh_tree.h"

#include <oneapi/tbb/parallel_invoke.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "collider/field/layout/path.h"
#include "sdf/base/triangle_corners.h"

namespace bilayer::detail {
namespace {

/// Longer triangles are halved: around shorter ones single precision is accurate to 2e-6 [voxels].
constexpr double maxEdge = 16;
/// Thinner triangles have no reliable normal [voxels].
constexpr double minHeight = 1e-7;
/// Points farther from the mesh than `maxDistance` are replaced by points in the same direction at `clampedDistance`
/// [mesh sizes]. There, single precision is off by a thousandth of a size, and the change of direction to off-centre
/// features by half as much. Both are less than a millionth of the distance of points beyond `maxDistance`.
constexpr double maxDistance = 4000, clampedDistance = 1000;
/// The accuracy of distances: places closer than this count as one. A point projects into a triangle if it is this far
/// from all edges, despite single-precision rounding [voxels].
constexpr double distanceTolerance = 1e-5;
/// Up to this distance, single precision is as accurate as the vertices [voxels].
constexpr double near = 16;
/// Max rounding of a point in floats, relative to its largest coordinate.
constexpr double pointRounding = 1.2e-7;

// A place on an edge, relative to the query point.
struct OnEdge {
    glm::dvec3 offset;
    double distance2;
    int corner;  // an end, or -1 between them
};

OnEdge closestOnEdge(const std::array<glm::dvec3, 3>& c, int from) {
    const int to = (from + 1) % 3;
    const glm::dvec3 &a = c[std::size_t(from)], &b = c[std::size_t(to)], ab = b - a;
    const double length2 = glm::dot(ab, ab), along = -glm::dot(a, ab);
    if (!(along > 0)) return {a, glm::dot(a, a), from};
    if (along >= length2) return {b, glm::dot(b, b), to};
    const double t = along / length2;
    // from the nearer end: both triangles of an edge find the same point, whatever its direction in them
    const glm::dvec3 offset = t <= 0.5 ? a + t * ab : b - (1 - t) * ab;
    return {offset, glm::dot(offset, offset), -1};
}

}  // namespace

MeshTree::MeshTree(std::shared_ptr<const Mesh> mesh, float voxelSize)
    : mesh_((validate(*mesh), std::move(mesh))), voxelSize_(voxelSize), perMetre_(1 / double(voxelSize)) {
    const auto makeTree = [&] {
        tree_ = makeWideTree(*mesh_, voxelSize_, nullptr, {TreeOrder::split, maxEdge});
        groups_ = makeOrientedBoxes(tree_);
    };
    tbb::parallel_invoke(makeTree, [&] { normals_ = FeatureNormals(*mesh_, minHeight * double(voxelSize_)); });
}

std::pair<glm::dvec3, glm::dvec3> MeshTree::box() const noexcept {
    const double voxel = voxelSize_;
    const glm::dvec3 base(tree_.base), size(tree_.size);
    return {(base - 1.0) * voxel, (base + size + 1.0) * voxel};
}

bool MeshTree::mayEnclose(const glm::dvec3& point) const noexcept {
    const auto [lower, upper] = box();
    return point == glm::clamp(point, lower, upper);
}

glm::dvec3 MeshTree::approached(const glm::dvec3& point) const noexcept {
    const auto [lower, upper] = box();
    return detail::approached(point, lower, upper, maxDistance, clampedDistance);
}

NearestFeature MeshTree::featureOfPiece(std::uint32_t piece, const glm::dvec3& point) const noexcept {
    const WideLeaf& leaf = tree_.leaves[piece / treeWidth];
    const std::uint32_t i = piece % treeWidth, triangle = leaf.triangles[i];
    const auto vectorOf = [i](const float(&v)[3][treeWidth]) { return glm::dvec3(v[0][i], v[1][i], v[2][i]); };
    const glm::dvec3 from = toTree(point) - vectorOf(leaf.cell) - vectorOf(leaf.corner);
    const glm::dvec3 along = vectorOf(leaf.along), normal = vectorOf(leaf.normal);
    const double x = glm::dot(from, along), y = glm::dot(from, glm::cross(normal, along)), z = glm::dot(from, normal);
    const double acrossBC = double(leaf.directionBC[0][i]) * y -
                            double(leaf.directionBC[1][i]) * (x - double(leaf.lengthAB[i])),
                 acrossAC = double(leaf.directionAC[1][i]) * x - double(leaf.directionAC[0][i]) * y;
    const double room = roomAt(point) * perMetre_;
    const bool over = std::min({y, acrossBC, acrossAC}) > room && std::abs(z) < near;
    if (!over || normals_.hasNoNormal(triangle)) return featureOf(triangle, point);
    return {.triangle = triangle,
            .offset = (-z * double(voxelSize_)) * normal,
            .normal = normal,
            .isOnSurface = std::abs(z) <= room};
}

// The distance from a feature up to which a point counts as on it [m].
double MeshTree::roomAt(const glm::dvec3& point) const noexcept {
    const double largest = std::max({std::abs(point.x), std::abs(point.y), std::abs(point.z)});
    return std::max(distanceTolerance * double(voxelSize_), pointRounding * largest);
}

// Selects the vertex or edge of a triangle that a point on its surface lies on, if any. Keeps the normal if that of the
// feature is unknown.
void MeshTree::toSmallest(NearestFeature& found, const std::array<glm::dvec3, 3>& c, double room) const noexcept {
    const auto set = [&](Feature feature, std::size_t index, const glm::dvec3& normal) {
        found.feature = feature;
        found.index = std::uint8_t(index);
        if (glm::length(normal) > minMeanNormal) found.normal = normal;
    };
    const glm::uvec3& t = mesh_->triangles[found.triangle];
    for (int k = 0; k < 3; ++k)
        if (glm::length(c[std::size_t(k)]) <= room)
            return set(Feature::vertex, std::size_t(k), normals_.ofVertex(t[k]));
    for (int k = 0; k < 3; ++k)
        if (closestOnEdge(c, k).distance2 <= room * room)
            return set(Feature::edge, std::size_t(k), normals_.ofEdge(found.triangle, k));
}

NearestFeature MeshTree::featureOf(std::uint32_t triangle, const glm::dvec3& point) const noexcept {
    const glm::uvec3& t = mesh_->triangles[triangle];
    const std::array<glm::dvec3, 3> c{glm::dvec3(mesh_->points[t.x]) - point, glm::dvec3(mesh_->points[t.y]) - point,
                                      glm::dvec3(mesh_->points[t.z]) - point};
    const std::array<glm::dvec3, 3> edges{c[1] - c[0], c[2] - c[1], c[0] - c[2]};
    const glm::dvec3 n = glm::cross(edges[0], edges[1]);
    const double n2 = glm::dot(n, n);
    const double longest2 =
        std::max({glm::dot(edges[0], edges[0]), glm::dot(edges[1], edges[1]), glm::dot(edges[2], edges[2])});
    NearestFeature found{.triangle = triangle};
    const auto inside = [&](std::size_t i) { return glm::dot(glm::cross(c[i], edges[i]), n) >= 0; };
    if (n2 > minRelativeHeight * minRelativeHeight * longest2 * longest2 && inside(0) && inside(1) && inside(2)) {
        found.offset = (glm::dot(c[0], n) / n2) * n;
        if (!normals_.hasNoNormal(triangle)) found.normal = n / std::sqrt(n2);
    } else {
        toEdge(found, c);
    }
    const double room = roomAt(point);
    found.isOnSurface = glm::length(found.offset) <= room;
    if (found.isOnSurface) toSmallest(found, c, room);
    return found;
}

// Selects the closest edge or vertex of a triangle.
void MeshTree::toEdge(NearestFeature& found, const std::array<glm::dvec3, 3>& c) const noexcept {
    OnEdge best = closestOnEdge(c, 0);
    int edge = 0;
    for (int i = 1; i < 3; ++i) {
        const OnEdge other = closestOnEdge(c, i);
        if (other.distance2 < best.distance2) best = other, edge = i;
    }
    found.offset = best.offset;
    found.feature = best.corner < 0 ? Feature::edge : Feature::vertex;
    found.index = std::uint8_t(best.corner < 0 ? edge : best.corner);
    found.normal = best.corner < 0 ? normals_.ofEdge(found.triangle, edge)
                                   : normals_.ofVertex(mesh_->triangles[found.triangle][best.corner]);
}

std::size_t MeshTree::memoryBytes() const {
    return mesh_->points.size() * sizeof(glm::vec3) + mesh_->triangles.size() * sizeof(glm::uvec3) +
           tree_.leafCount * sizeof(WideLeaf) + tree_.groupCount * (sizeof(BoxGroup) + sizeof(OrientedBoxes)) +
           normals_.memoryBytes();
}

}  // namespace bilayer::detail
