// SPDX-License-Identifier: Apache-2.0
#include <bilayer/collider/distance.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <stdexcept>

#include "sdf/base/finite.h"

namespace bilayer {

using namespace detail;

namespace {

/// The default tolerance [voxels], and the lower limit of all [sizes of the larger body].
constexpr double defaultTolerance = 0.05, minTolerance = 1e-5;
/// A body that rotates by more has no motion of one step [rad].
constexpr float maxRotation = 1000;

void check(const Motion& motion) {
    if (!isFinite(motion.displacement) || !isFinite(motion.rotation))
        throw std::invalid_argument("the motion is not finite");
    if (glm::length(glm::dvec3(motion.rotation)) > maxRotation)
        throw std::invalid_argument("the motion rotates by more than 1000 rad");
}

/// The body after a fraction of its motion.
Placed after(const Placed& body, double fraction) {
    const glm::dvec3 turned = fraction * glm::dvec3(body.motion.rotation);
    const double angle = glm::length(turned);
    glm::dquat rotation(body.pose.rotation);
    if (angle > 0) rotation = glm::angleAxis(angle, turned / angle) * rotation;
    const glm::dvec3 position = glm::dvec3(body.pose.position) + fraction * glm::dvec3(body.motion.displacement);
    return {body.collider, {glm::vec3(position), glm::quat(glm::normalize(rotation))}, body.scale};
}

/// The largest distance of a point of the body from its pose position [m].
double radiusOf(const Placed& body) {
    const Bounds& bounds = body.collider.bounds();
    return double(body.scale) * glm::length(glm::dvec3(glm::max(glm::abs(bounds.lower), glm::abs(bounds.upper))));
}

double toleranceFor(const Placed& a, const Placed& b, float asked) {
    const auto size = [](const Placed& body) {
        return double(body.scale) * double(body.collider.bounds().longestSide());
    };
    const auto voxel = [](const Placed& body) {
        return double(body.scale) * double(body.collider.field().voxelSize());
    };
    const double wanted = asked > 0 ? double(asked) : defaultTolerance * std::min(voxel(a), voxel(b));
    return std::max(wanted, minTolerance * std::max(size(a), size(b)));
}

}  // namespace

Impact timeOfImpact(const Placed& a, const Placed& b, const ImpactOptions& options) {
    check(a.motion);
    check(b.motion);
    const double tolerance = toleranceFor(a, b, options.tolerance);
    const auto rotationOf = [](const Placed& body) {
        return glm::length(glm::dvec3(body.motion.rotation)) * radiusOf(body);
    };
    // no two points approach by more in the whole motion
    const double approach = glm::distance(glm::dvec3(a.motion.displacement), glm::dvec3(b.motion.displacement)) +
                            rotationOf(a) + rotationOf(b);
    DistanceStart start;
    for (double fraction = 0; fraction <= 1;) {
        const Placed nowA = after(a, fraction), nowB = after(b, fraction);
        const auto limit = float(approach * (1 - fraction) + tolerance);
        const BodyDistance separation = distance(nowA, nowB, {.maxDistance = limit}, &start);
        if (!separation.found) return {};
        if (separation.overlap != Overlap::none || separation.distance <= tolerance)
            return {true, float(fraction), nowA.pose, nowB.pose, separation};
        // half of the tolerance is left, so that the bodies come near, and never touch
        fraction += (double(separation.distance) - 0.5 * tolerance) / approach;
    }
    return {};
}

}  // namespace bilayer
