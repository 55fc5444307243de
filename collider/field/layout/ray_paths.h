// SPDX-License-Identifier: Apache-2.0
// Rays as paths, and the hits of rays that start inside.
// Tested by tests/collider/field_rays.cpp through Field::raycast().
#pragma once

#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include <bilayer/collider/query.h>
#include "collider/field/layout/field_layout.h"
#include "collider/field/layout/path.h"
#include "sdf/base/finite.h"

namespace bilayer::detail {

inline bool isRay(const Ray& ray) {
    return isFinite(ray.origin) && isFinite(ray.direction) && ray.direction != glm::vec3(0) && ray.maxDistance >= 0;
}

inline Path pathOf(const Ray& ray) {
    return {glm::dvec3(ray.origin), glm::normalize(glm::dvec3(ray.direction)), double(ray.maxDistance)};
}

/// A path in voxels from the directory's first voxel.
inline Path toLocal(const FieldFrame& frame, const Path& path) {
    return {(path.origin - frame.origin) * frame.perMetre, path.direction, path.length * frame.perMetre};
}

/// The hit of a ray that starts inside.
inline RayHit hitAtStart(const Sample& start, const glm::vec3& origin, const glm::dvec3& direction) {
    const float steepness = glm::length(start.gradient);
    return {.distance = 0,
            .position = origin,
            .normal = steepness > 0 ? start.gradient / steepness : glm::vec3(-direction)};
}

}  // namespace bilayer::detail
