// Rays and spheres on their way: with the mesh its triangles decide, else the zero set of the interpolant.
#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>

#include "collider/field.h"
#include "collider/field_data.h"
#include "collider/mesh_rays.h"
#include "collider/zero_set.h"

namespace bilayer {
namespace {

/// Segments are this much longer, so that those that end on a face meet it.
constexpr double endRounding = 1 + 1e-12;
/// Spheres of a smaller radius are rays [voxels].
constexpr double leastRadius = 1e-6;
/// A sphere's way is looked at piece by piece [voxels], and in no more pieces than this.
constexpr double pieceLength = 2, mostPieces = 4096;
/// A sphere is looked for its nearest triangle no farther than this away from it [pieces].
constexpr double lookAhead = 4;
/// What the nearest triangle may be off by [voxels], and as a part of its distance.
constexpr double nearestSlack = 1e-4, nearestRounding = 2e-6;

bool isRay(const Ray& ray) {
    return isFinite(ray.origin) && isFinite(ray.direction) && ray.direction != glm::vec3(0) && ray.maxDistance >= 0;
}

Path pathOf(const Ray& ray) {
    return {glm::dvec3(ray.origin), glm::normalize(glm::dvec3(ray.direction)), double(ray.maxDistance)};
}

// Of a face, against the path.
glm::vec3 normalOf(const Mesh& mesh, const MeshHit& hit, const Path& path) {
    const Corners c = cornersOf(mesh, hit.triangle);
    const glm::dvec3 n = glm::normalize(glm::cross(c[1] - c[0], c[2] - c[0]));
    return glm::vec3(glm::dot(n, path.direction) > 0 ? -n : n);
}

// Where a ray starts inside.
RayHit hitAtStart(const FieldData& field, const glm::vec3& origin, const glm::dvec3& direction) {
    const glm::vec3 gradient = field.sample(field.toLocal(origin), std::numeric_limits<float>::infinity()).gradient;
    const float steepness = glm::length(gradient);
    return {.distance = 0, .position = origin, .normal = steepness > 0 ? gradient / steepness : glm::vec3(-direction)};
}

// In voxels from the directory's first one.
Path toLocal(const FieldData& field, const Path& path) {
    return {(path.origin - field.origin) * field.perMetre, path.direction, path.length * field.perMetre};
}

std::optional<RayHit> hitMesh(const MeshTree& mesh, const Path& path) {
    const auto hit = firstHit(mesh, path);
    if (!hit) return std::nullopt;
    return RayHit{float(hit->along), glm::vec3(hit->position), normalOf(mesh.mesh(), *hit, path), hit->triangle};
}

std::optional<RayHit> hitZero(const FieldData& field, const Path& path) {
    const Path local = toLocal(field, path);
    const auto along = firstInside(field, local);
    if (!along) return std::nullopt;
    const glm::dvec3 normal = zeroNormal(field, local.at(*along));
    return RayHit{.distance = float(*along * field.voxel),
                  .position = field.toWorld(local.at(*along)),
                  .normal = glm::vec3(normal != glm::dvec3(0) ? normal : -path.direction)};
}

// What a sphere may go on along a path before it touches the mesh; no more is asked for than `reach` [m].
double wayLeft(const FieldData& field, const glm::dvec3& centre, double radius, double reach) {
    const double slack = nearestSlack * field.voxel;
    const Sample here = field.sample((centre - field.origin) * field.perMetre);
    const double bound = here.inBand ? 0 : double(here.distance) - double(field.error) - radius - slack;
    if (bound >= reach) return bound;
    const std::uint32_t triangle = field.mesh->nearest(centre, float((radius + reach) * field.perMetre));
    const double way =
        triangle == noTriangle ? radius + reach : glm::length(field.mesh->featureOf(triangle, centre).way);
    return way * (1 - nearestRounding) - radius - slack;
}

// Through what is empty in strides, as J. C. Hart, "Sphere tracing", The Visual Computer 12 (1996) 527-545; what may be
// touched within the next piece is looked at triangle by triangle, so that a sphere that grazes the surface takes no
// more steps than there are pieces.
std::optional<RayHit> touchMesh(const FieldData& field, const Path& path, double radius) {
    const auto part = clip(path, glm::dvec3(field.bounds.lower) - radius, glm::dvec3(field.bounds.upper) + radius);
    if (!part) return std::nullopt;
    const auto [from, to] = *part;
    const double piece = std::max(pieceLength * field.voxel, (to - from) / mostPieces);
    for (double along = from; along <= to;) {
        const double left = wayLeft(field, path.at(along), radius, lookAhead * piece);
        if (left > piece) {
            along += left;
            continue;
        }
        const Path next{path.at(along), path.direction, std::min(piece, to - along)};
        if (const auto hit = firstTouch(*field.mesh, next, radius))
            return RayHit{.distance = float(along + hit->along),
                          .position = glm::vec3(hit->position),
                          .normal = glm::vec3(glm::normalize(next.at(hit->along) - hit->position)),
                          .triangle = hit->triangle};
        along += piece;
    }
    return std::nullopt;
}

std::optional<RayHit> touchZero(const FieldData& field, const Path& path, double radius) {
    const Path local = toLocal(field, path);
    const auto touch = firstZeroTouch(field, local, radius * field.perMetre);
    if (!touch) return std::nullopt;
    return RayHit{.distance = float(touch->along * field.voxel),
                  .position = field.toWorld(touch->position),
                  .normal = glm::vec3(glm::normalize(local.at(touch->along) - touch->position))};
}

// From outside or inside.
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
    const glm::dvec3 way = glm::dvec3(to) - glm::dvec3(from);
    const double length = glm::length(way);
    if (length > 0) return cast(*data_, from, {glm::dvec3(from), way / length, length * endRounding});
    if (!data_->inside(from)) return std::nullopt;
    return hitAtStart(*data_, from, {0, 0, -1});
}

std::optional<RayHit> Field::sphereCast(const Ray& ray, float radius) const noexcept {
    if (!isRay(ray) || !(radius >= 0) || !std::isfinite(radius)) return std::nullopt;
    if (double(radius) * data_->perMetre < leastRadius) return raycast(ray);
    const ClosestPoint start = data_->closest(ray.origin, radius);
    if (start.found)
        return RayHit{.distance = 0, .position = start.position, .normal = start.normal, .triangle = start.triangle};
    const Path path = pathOf(ray);
    if (data_->inside(ray.origin)) return hitAtStart(*data_, ray.origin, path.direction);
    return data_->mesh ? touchMesh(*data_, path, double(radius)) : touchZero(*data_, path, double(radius));
}

}  // namespace bilayer
