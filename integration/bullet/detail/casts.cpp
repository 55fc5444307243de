// SPDX-License-Identifier: Apache-2.0
#include "integration/bullet/detail/casts.h"
#include <bilayer/collider/contact.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "collider/field/layout/interpolant.h"
#include "collider/field/queries/sphere_tracing.h"

namespace bilayer::bullet::detail {

using namespace bilayer::detail;

namespace {

// Distance that counts as contact, far below the accuracy of a field's surface [voxels].
constexpr float touchVoxels = 1e-3f;
// Factor on steps in the band: an interpolated distance may change by more than the displacement.
constexpr float caution = 0.8f;
// Limit of steps. Each is at least touchVoxels / 2 long, so that it only ends paths that graze the surface for
// thousands of voxels.
constexpr int maxSteps = 100000;
}  // namespace

bool bandFitsSphere(const Placed& body, float radius) {
    const Field& field = body.collider.field();
    // Beyond the band the distance is a lower bound, which falls to this value near the band. A sphere of that radius
    // could touch anywhere there.
    const float voxel = field.voxelSize(), minBound = surelyInBand(field.exteriorWidth(), voxel) - touchVoxels * voxel;
    return radius < body.scale * minBound;
}

std::optional<CastHit> castSphereOn(const Placed& body, const glm::vec3& from, const glm::vec3& to, float radius,
                                    float allowed) {
    const Field& field = body.collider.field();
    const glm::vec3 start = body.pose.toBody(from) / body.scale, end = body.pose.toBody(to) / body.scale;
    const float length = glm::length(end - start);
    if (!(length > 0)) return std::nullopt;
    const glm::vec3 direction = (end - start) / length;
    const float separationAtHit = (radius - allowed) / body.scale;
    const float touch = touchVoxels * field.voxelSize();

    float travelled = 0;
    for (int i = 0; i < maxSteps && travelled <= length; ++i) {
        const glm::vec3 centre = start + travelled * direction;
        const Sample sample = field.sample(centre);
        const float separation = sample.distance - separationAtHit;
        if (separation <= touch) {
            const bool inward = glm::dot(sample.gradient, direction) < 0;
            if (inward) {
                const glm::vec3 normal = glm::normalize(sample.gradient);
                const glm::vec3 point = centre - sample.distance * normal;
                return CastHit{travelled / length, body.pose.toWorld(body.scale * point), body.pose.rotation * normal};
            }
            if (!sample.inBand) return std::nullopt;
        }
        const float step = sample.inBand ? caution * std::abs(separation) : std::abs(separation);
        travelled += std::max(step, 0.5f * touch);
    }
    return std::nullopt;
}

std::optional<CastHit> castSphereOn(const MeshTree& mesh, const glm::vec3& from, const glm::vec3& to, float radius) {
    const glm::dvec3 displacement = glm::dvec3(to) - glm::dvec3(from);
    const double length = glm::length(displacement);
    if (!(length > 0)) return std::nullopt;
    const Path path{glm::dvec3(from), displacement / length, length};
    const auto touch = castSphereFar(mesh, path, radius, [](const glm::dvec3&) { return 0.; });
    if (!touch) return std::nullopt;
    return CastHit{static_cast<float>(touch->along / length), glm::vec3(touch->position), glm::vec3(touch->normal),
                   static_cast<int>(touch->triangle)};
}

bool touches(const MeshTree& mesh, const glm::vec3& centre, float radius) {
    const glm::dvec3 point(centre);
    const std::uint32_t triangle = mesh.nearest(point, 2 * radius / mesh.voxelSize());
    return triangle != noTriangle && glm::length(mesh.featureOf(triangle, point).offset) < static_cast<double>(radius);
}

}  // namespace bilayer::bullet::detail
