// SPDX-License-Identifier: Apache-2.0
#include "collider/contact/search/surface_query.h"

#include <cmath>
#include <glm/geometric.hpp>

#include "collider/field/layout/interpolant.h"

namespace bilayer::detail {

namespace {

// A shorter gradient has no direction. On the surface even a short one has: next to a sharp edge, the interpolant of
// the voxels below rises only by the distance to the edge in voxels.
constexpr float minGradient = 0.1f, minGradientOnSurface = 1e-3f;
constexpr float onSurface = 0.01f;  // [voxels]: includes all gradients below 0.1 in the voxels of an edge
constexpr float minOffset = 0.01f;  // [voxels] from an edge or vertex; nearer, rounding spoils the direction

}  // namespace

glm::vec3 directionOf(const Sample& sample, float voxelSize) {
    const float length = glm::length(sample.gradient);
    const bool isOnSurface = std::abs(sample.distance) <= onSurface * voxelSize;
    return length > (isOnSurface ? minGradientOnSurface : minGradient) ? sample.gradient / length : glm::vec3(0);
}

glm::vec3 directionOf(const ClosestPoint& closest, const glm::vec3& point, float voxelSize) {
    const bool mayBeOffFace = closest.feature != Feature::face || closest.triangle == noTriangle;
    const bool isOffFace = mayBeOffFace && std::abs(closest.distance) > minOffset * voxelSize;
    return isOffFace ? (point - closest.position) / closest.distance : closest.normal;
}

SurfaceSample surfaceSampleAt(const Field& field, const glm::vec3& point, const Sample& sample, bool byTriangles) {
    if (byTriangles) {
        const float maxDistance = std::abs(sample.distance) + maxInterpolationError * field.voxelSize();
        if (const ClosestPoint closest = field.closest(point, maxDistance); closest.found)
            return {closest.distance, directionOf(closest, point, field.voxelSize())};
    }
    return {sample.distance, directionOf(sample, field.voxelSize())};
}

}  // namespace bilayer::detail
