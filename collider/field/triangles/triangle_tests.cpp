// SPDX-License-Identifier: Apache-2.0
#include "collider/field/triangles/triangle_tests.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <glm/vec2.hpp>
#include <glm/vector_relational.hpp>

namespace bilayer::detail {
namespace {

/// Max distance that counts as contact of a sphere [voxels].
constexpr double touchTolerance = 1e-7;

}  // namespace

TriangleRay::TriangleRay(const glm::dvec3& start, const glm::dvec3& direction, double tolerance)
    : start_(start), tolerance_(tolerance) {
    const glm::dvec3 size = glm::abs(direction);
    z_ = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
    x_ = (z_ + 1) % 3, y_ = (z_ + 2) % 3;
    perZ_ = 1 / direction[z_];
    shearX_ = direction[x_] * perZ_, shearY_ = direction[y_] * perZ_;
}

// Translated and sheared so that the ray becomes the z axis, and z the distance along the ray.
glm::dvec3 TriangleRay::sheared(const glm::dvec3& corner) const {
    const glm::dvec3 p = corner - start_;
    return {p[x_] - shearX_ * p[z_], p[y_] - shearY_ * p[z_], perZ_ * p[z_]};
}

bool TriangleRay::meets(const TriangleCorners& corners, double& along, glm::dvec3& position) const {
    const TriangleCorners projected{sheared(corners[0]), sheared(corners[1]), sheared(corners[2])};
    const auto& [a, b, c] = projected;
    // twice the areas between the axis and the edges; both triangles of a shared edge get the same number for it
    glm::dvec3 weights{c.x * b.y - c.y * b.x, a.x * c.y - a.y * c.x, b.x * a.y - b.y * a.x};
    const double facing = weights.x + weights.y + weights.z;
    if (facing == 0) return false;
    if (facing < 0) weights = -weights;
    if (glm::all(glm::greaterThanEqual(weights, glm::dvec3(0))))
        weights /= std::abs(facing);
    else if (!passesEdge(projected, weights))
        return false;
    const double here = weights.x * a.z + weights.y * b.z + weights.z * c.z;
    if (!(here < along)) return false;
    const bool entering = (facing < 0) == (perZ_ < 0);
    if (here < (entering ? -tolerance_ : 0)) return false;
    along = std::max(here, 0.0);
    position = weights.x * corners[0] + weights.y * corners[1] + weights.z * corners[2];
    return true;
}

// Whether the axis, outside the triangle, passes an edge within the tolerance. The weights become those of the closest
// point on the edge.
bool TriangleRay::passesEdge(const TriangleCorners& projected, glm::dvec3& weights) const {
    double nearest = tolerance_ * tolerance_;
    bool found = false;
    const glm::dvec3 areas = weights;
    for (int k = 0; k < 3; ++k) {
        if (areas[k] >= 0) continue;
        const int from = (k + 1) % 3, to = (k + 2) % 3;
        const glm::dvec2 start(projected[from]), edge = glm::dvec2(projected[to]) - start;
        const double length2 = glm::dot(edge, edge);
        if (areas[k] * areas[k] > nearest * length2) continue;
        const double part = length2 > 0 ? std::clamp(-glm::dot(start, edge) / length2, 0.0, 1.0) : 0;
        const glm::dvec2 passed = start + part * edge;
        if (glm::dot(passed, passed) > nearest) continue;
        nearest = glm::dot(passed, passed);
        weights = {0, 0, 0}, weights[from] = 1 - part, weights[to] = part;
        found = true;
    }
    return found;
}

// The distance to a triangle is convex along the path, so tangents never lead past the first contact. A sphere that has
// made none after the last step passes the triangle within the tolerance.
bool touches(const MeshTree& mesh, std::uint32_t triangle, const Path& path, double radius, double& along,
             glm::dvec3& position) {
    const double tolerance = touchTolerance * double(mesh.voxelSize());
    double here = 0;
    for (int i = 0; i < maxTangents; ++i) {
        const glm::dvec3 centre = path.at(here), from = mesh.approached(centre);
        const glm::dvec3 offset = mesh.featureOf(triangle, from).offset, delta = offset + (from - centre);
        const double distance = glm::length(delta), left = distance - radius;
        if (left <= tolerance) {
            along = here;
            position = from + offset;
            return true;
        }
        const double approach = glm::dot(delta, path.direction) / distance;
        if (!(approach > 0)) return false;
        here += left / approach;
        if (!(here < along)) return false;
    }
    return false;
}

bool overlaps(const RotatedBox& box, const TriangleCorners& corners) {
    const glm::dmat3 toBox = glm::transpose(box.axes);
    const TriangleCorners p{toBox * (corners[0] - box.centre), toBox * (corners[1] - box.centre),
                            toBox * (corners[2] - box.centre)};
    const auto separates = [&](const glm::dvec3& axis) {
        const double reach = glm::dot(glm::abs(axis), box.halfSize);
        const double a = glm::dot(axis, p[0]), b = glm::dot(axis, p[1]), c = glm::dot(axis, p[2]);
        return std::min({a, b, c}) > reach || std::max({a, b, c}) < -reach;
    };
    for (int k = 0; k < 3; ++k)
        if (std::min({p[0][k], p[1][k], p[2][k]}) > box.halfSize[k] ||
            std::max({p[0][k], p[1][k], p[2][k]}) < -box.halfSize[k])
            return false;
    const TriangleCorners edges{p[1] - p[0], p[2] - p[1], p[0] - p[2]};
    if (separates(glm::cross(edges[0], edges[1]))) return false;
    for (const glm::dvec3& e : edges)
        if (separates({0, -e.z, e.y}) || separates({e.z, 0, -e.x}) || separates({-e.y, e.x, 0})) return false;
    return true;
}

}  // namespace bilayer::detail
