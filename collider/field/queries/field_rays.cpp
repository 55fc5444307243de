// SPDX-License-Identifier: Apache-2.0
// Ray and sphere casts: against the triangles if there is a mesh, otherwise against the zero set of the interpolant.
// Tested by tests/collider/field_rays.cpp through raycast().
#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>

#include <bilayer/collider/field.h>
#include "collider/field/layout/ray_paths.h"
#include "collider/field/queries/sphere_tracing.h"
#include "collider/field/samples/field_data.h"
#include "collider/field/triangles/mesh_rays.h"
#include "collider/field/triangles/triangle_tests.h"
#include "collider/field/zero/zero_answers.h"
#include "collider/field/zero/zero_set.h"

namespace bilayer {

using namespace detail;

namespace {

/// Segments are extended by this factor, so that those that end on a face hit it.
constexpr double endRounding = 1 + 1e-12;
/// Spheres with a smaller radius are cast as rays [voxels].
constexpr double minRadius = 1e-6;

// The normal of the hit face, facing the path's start.
glm::vec3 normalOf(const Mesh& mesh, const MeshHit& hit, const Path& path) {
    const TriangleCorners c = cornersOf(mesh, hit.triangle);
    const glm::dvec3 n = glm::normalize(glm::cross(c[1] - c[0], c[2] - c[0]));
    return glm::vec3(glm::dot(n, path.direction) > 0 ? -n : n);
}

RayHit hitAtStart(const FieldData& field, const glm::vec3& origin, const glm::dvec3& direction) {
    return detail::hitAtStart(field.sample(field.toLocal(origin), std::numeric_limits<float>::infinity()), origin,
                              direction);
}

std::optional<RayHit> hitMesh(const MeshTree& mesh, const Path& path) {
    const auto hit = firstHit(mesh, path);
    if (!hit) return std::nullopt;
    return RayHit{toFloat(hit->along), glm::vec3(hit->position), normalOf(mesh.mesh(), *hit, path), hit->triangle};
}

std::optional<RayHit> hitZero(const FieldData& field, const Path& path) {
    return detail::hitZero(field, path, [&](const Path& local) -> std::optional<ZeroPoint> {
        const auto along = firstInside(field, local);
        if (!along) return std::nullopt;
        const glm::dvec3 position = local.at(*along);
        return ZeroPoint{position, zeroNormal(field, position), *along};
    });
}

std::optional<RayHit> touchMesh(const FieldData& field, const Path& path, double radius) {
    const auto clearanceAt = [&](const glm::dvec3& centre) {
        const Sample here = field.sample((centre - field.origin) * field.perMetre);
        return here.inBand ? 0 : double(here.distance) - double(field.error);
    };
    const auto touch = castSphereFar(*field.mesh, path, radius, clearanceAt);
    if (!touch) return std::nullopt;
    return RayHit{toFloat(touch->along), glm::vec3(touch->position), glm::vec3(touch->normal), touch->triangle};
}

std::optional<RayHit> touchZero(const FieldData& field, const Path& path, double radius) {
    const double reach = radius * field.perMetre;
    const auto section = sectionIn(toLocal(field, path), glm::dvec3(-reach), field.extent() + reach);
    if (!section) return std::nullopt;
    auto touch = firstZeroTouch(field, section->path, reach);
    if (!touch) return std::nullopt;
    const glm::dvec3 centre = section->path.at(touch->along), from = approachedPoint(field, centre);
    // from so far away several zeros may be equally near: take the nearest one
    if (from != centre) touch->position = nearestZero(field, from, std::numeric_limits<double>::infinity()).value();
    return RayHit{.distance = toFloat((section->from + touch->along) * field.voxel),
                  .position = field.toWorld(touch->position),
                  .normal = glm::vec3(glm::normalize(centre - touch->position))};
}

// Casts from outside or inside.
std::optional<RayHit> cast(const FieldData& field, const glm::vec3& origin, const Path& path) {
    if (field.inside(origin)) return hitAtStart(field, origin, path.direction);
    return field.mesh ? hitMesh(*field.mesh, path) : hitZero(field, path);
}

}  // namespace

std::optional<RayHit> Field::raycast(const Ray& ray) const noexcept {
    if (!isRay(ray)) return std::nullopt;
    return cast(*data_, ray.origin, pathOf(ray));
}

std::optional<RayHit> Field::segment(const glm::vec3& from, const glm::vec3& to) const noexcept {
    if (!isFinite(from) || !isFinite(to)) return std::nullopt;
    const glm::dvec3 delta = glm::dvec3(to) - glm::dvec3(from);
    const double length = glm::length(delta);
    if (length > 0) return cast(*data_, from, {glm::dvec3(from), delta / length, length * endRounding});
    if (!data_->inside(from)) return std::nullopt;
    return hitAtStart(*data_, from, {0, 0, -1});
}

std::optional<RayHit> Field::sphereCast(const Ray& ray, float radius) const noexcept {
    if (!isRay(ray) || !(radius >= 0) || !std::isfinite(radius)) return std::nullopt;
    if (double(radius) * data_->perMetre < minRadius) return raycast(ray);
    const ClosestPoint start = data_->closest(ray.origin, radius);
    if (start.found)
        return RayHit{.distance = 0, .position = start.position, .normal = start.normal, .triangle = start.triangle};
    const Path path = pathOf(ray);
    if (data_->inside(ray.origin)) return hitAtStart(*data_, ray.origin, path.direction);
    return data_->mesh ? touchMesh(*data_, path, double(radius)) : touchZero(*data_, path, double(radius));
}

}  // namespace bilayer
