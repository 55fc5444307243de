// SPDX-License-Identifier: Apache-2.0
// What fields without a mesh answer, in one piece or in tiles: the closest point of the zero set, and the hit of a ray.
// Tested by tests/collider/field_rays.cpp through Field::raycast().
#pragma once

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <limits>
#include <optional>

#include <bilayer/collider/query.h>
#include "collider/field/layout/outer_bound.h"
#include "collider/field/layout/ray_paths.h"
#include "collider/field/samples/field_data.h"

namespace bilayer::detail {

/// A point of the zero set, with the outward unit normal; zero where the interpolant is flat. In voxels from the
/// directory's first voxel.
struct ZeroPoint {
    glm::dvec3 position, normal;
    double along = 0;  ///< distance along the path, if there is one
};

/// The closest point of the zero set, in field coordinates.
/// @param nearest   (glm::dvec3 point, double reach) -> std::optional<ZeroPoint>, as nearestZero()
/// @param isInside  () -> bool: whether the point is inside
template <class Nearest, class IsInside>
ClosestPoint closestZero(const FieldFrame& frame, const glm::vec3& point, float maxDistance, const Nearest& nearest,
                         const IsInside& isInside) {
    const glm::dvec3 local = frame.toLocal(point);
    if (!std::isfinite(local.x + local.y + local.z) || !(maxDistance >= 0)) return {};
    const glm::dvec3 from = approachedPoint(frame, local);
    const double reach = double(maxDistance) * frame.perMetre;
    const std::optional<ZeroPoint> zero =
        nearest(from, from == local ? reach : std::numeric_limits<double>::infinity());
    if (!zero || glm::distance(local, zero->position) > reach) return {};
    const float distance = toFloat(glm::distance(local, zero->position) * frame.voxel);
    return {.distance = isInside() ? -distance : distance,
            .position = frame.toWorld(zero->position),
            .normal = glm::vec3(zero->normal),
            .found = true};
}

/// The hit of a ray that starts outside.
/// @param path   in field coordinates
/// @param first  (Path) -> std::optional<ZeroPoint>, as firstInside()
template <class First>
std::optional<RayHit> hitZero(const FieldFrame& frame, const Path& path, const First& first) {
    const auto section = sectionIn(toLocal(frame, path), glm::dvec3(0), frame.extent());
    if (!section) return std::nullopt;
    const std::optional<ZeroPoint> hit = first(section->path);
    if (!hit) return std::nullopt;
    return RayHit{.distance = toFloat((section->from + hit->along) * frame.voxel),
                  .position = frame.toWorld(hit->position),
                  .normal = glm::vec3(hit->normal != glm::dvec3(0) ? hit->normal : -path.direction)};
}

}  // namespace bilayer::detail
