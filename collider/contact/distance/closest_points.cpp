// SPDX-License-Identifier: Apache-2.0
#include "collider/contact/distance/closest_points.h"

#include <algorithm>
#include <glm/geometric.hpp>
#include <limits>
#include <optional>

namespace bilayer::detail {
namespace {

// Max count of iterations, and the step at which they end [voxels].
constexpr int maxIterations = 10;
constexpr float stepTolerance = 1e-4f;
// Max extrapolation, in lengths of the last step.
constexpr float maxExtrapolation = 50;
// Min distance of the closest points that defines a direction [voxels].
constexpr float minDirectedDistance = 1e-3f;

// The closest point on a body's surface for a place outside it, in world coordinates.
std::optional<glm::vec3> closestOn(const Placed& body, const glm::vec3& place, float maxDistance) {
    const ClosestPoint closest =
        body.collider.exactField().closest(body.pose.toBody(place) / body.scale, maxDistance / body.scale);
    if (!closest.found || closest.distance < 0) return std::nullopt;
    return body.pose.toWorld(body.scale * closest.position);
}

// By alternating projection. Where round bodies nearly touch, convergence is slow; A. C. Aitken's extrapolation
// accelerates it.
void refine(Contact& contact, const Placed& a, const Placed& b) {
    const float voxel = b.scale * b.collider.field().voxelSize();
    const auto projected = [&](const glm::vec3& place) -> std::optional<Contact> {
        const auto onA = closestOn(a, place, contact.distance + voxel);
        const auto onB = onA ? closestOn(b, *onA, contact.distance + voxel) : std::nullopt;
        if (!onB) return std::nullopt;
        const glm::vec3 fromB = *onA - *onB;
        const float distance = glm::length(fromB);
        const glm::vec3 normal = distance > minDirectedDistance * voxel ? fromB / distance : contact.normal;
        return Contact{*onB, normal, distance, contact.feature, contact.approach, contact.roundingRadius};
    };
    glm::vec3 lastStep(0);  // of the closest point
    for (int i = 0; i < maxIterations; ++i) {
        const auto next = projected(contact.position);
        if (!next) return;
        const glm::vec3 step = next->position - contact.position;
        contact = *next;
        if (!(glm::length(step) > stepTolerance * voxel)) return;
        const float ratio = glm::dot(step, lastStep) / glm::dot(lastStep, lastStep);
        lastStep = step;
        if (!(ratio > 0 && ratio < 1)) continue;
        const auto beyond = projected(contact.position + std::min(ratio / (1 - ratio), maxExtrapolation) * step);
        if (!beyond || beyond->distance >= contact.distance) continue;
        contact = *beyond;
        lastStep = glm::vec3(0);
    }
}

}  // namespace

void refineClosest(std::span<Contact> contacts, const Placed& a, const Placed& b) {
    float nearest = std::numeric_limits<float>::max();
    for (const Contact& contact : contacts) nearest = std::min(nearest, contact.distance);
    for (Contact& contact : contacts)
        if (contact.distance > 0 && contact.distance < nearest + b.scale * b.collider.field().voxelSize())
            refine(contact, a, b);
}

}  // namespace bilayer::detail
