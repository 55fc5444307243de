// SPDX-License-Identifier: Apache-2.0
#include "collider/contact/open_surface/face_height.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "collider/contact/body/collider_data.h"
#include "collider/contact/search/normal_filter.h"
#include "collider/field/layout/interpolant.h"
#include "sdf/base/access.h"

namespace bilayer::detail {

namespace {

// A face touches points whose normals oppose its own to within 5 degrees (cosine and sine).
constexpr float straight = 0.9962f, maxLean = 0.0872f;
// A surface with an opposite normal by this cosine is the far side of a thin body.
constexpr float farSide = -0.8f;

}  // namespace

bool FaceHeight::isExact(std::uint32_t index, const glm::vec3& normal, float height,
                         const LocalField::FieldSample& foot) const {
    const Collider& collider = field_.placed.collider;
    const SurfacePoint& point = dataOf(collider).points().points()[index];
    // a foot on the medial axis has no normal: then the normal of the face point decides the side
    const bool isUnclear = foot.where == LocalField::FieldSample::noNormal && !point.isSharp;
    const float facing = glm::dot(foot.normal, normal), required = point.isSharp ? minFacing : 0;
    const bool isNearSide =
        height >= 0 || isUnclear || (foot.where == LocalField::FieldSample::nearSurface && facing >= required);
    const bool isNearest = std::abs(foot.distance - height) <= maxInterpolationError * field_.voxel && isNearSide;
    const bool passes = passesNormalFilter({}, glm::dot(normal, point.normal), true);
    if (isNearest && passes &&
        (point.isSharp || hasEdgeNear(field_.placed.scale * point.position, point.normal, normal)))
        return true;
    if (!(isNearest || height < 0) || !isConvexVertex(index, normal)) return false;
    return isNearest || hasPenetrated(point, normal, height, distanceAlongAxis(point, normal, height));
}

bool FaceHeight::hasEdgeNear(const glm::vec3& place, const glm::vec3& surfaceNormal, const glm::vec3& normal) const {
    return holdsDuringRotation(normal, field_.local.relativeMotion().rotation(),
                               [&](const glm::vec3& rotated) { return hasEdgeNearNow(place, surfaceNormal, rotated); });
}

bool FaceHeight::hasEdgeNearNow(const glm::vec3& place, const glm::vec3& surfaceNormal, const glm::vec3& normal) const {
    const float cosine = glm::dot(surfaceNormal, normal);
    if (cosine >= straight) return true;
    const glm::vec3 deeper = glm::normalize(normal - cosine * surfaceNormal),
                    lean = glm::normalize(surfaceNormal - cosine * normal);
    const LocalField::FieldSample there = field_.local.at(place + field_.spacing * deeper);
    return there.where == LocalField::FieldSample::nearSurface && glm::dot(there.normal, lean) <= maxLean;
}

bool FaceHeight::isConvexVertex(std::uint32_t index, const glm::vec3& normal) const {
    const Collider& collider = field_.placed.collider;
    return dataOf(collider).points().points()[index].isSharp &&
           dataOf(collider).edges().isConvexVertex(dataOf(collider).points(), index, normal);
}

float FaceHeight::distanceAlongAxis(const SurfacePoint& vertex, const glm::vec3& normal, float height) {
    return -height / std::max(glm::dot(normal, vertex.normal), minFacing);
}

bool FaceHeight::hasPenetrated(const SurfacePoint& vertex, const glm::vec3& normal, float height,
                               float distance) const {
    const glm::vec3 place = field_.placed.scale * vertex.position, through = place - distance * vertex.normal;
    const glm::vec3 behind = through - maxInterpolationError * field_.voxel * vertex.normal;
    if (!(field_.local.at(behind).distance < 0)) return false;
    if (-height < field_.voxel) return true;
    return glm::dot(field_.local.at(through).normal, normal) > farSide &&
           triangles_.distance(through) < touchingDistanceVoxels * field_.voxel &&
           triangles_.distance(place) > (onFace - 1) * height;
}

}  // namespace bilayer::detail
