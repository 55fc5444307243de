// SPDX-License-Identifier: Apache-2.0
#include <bilayer/collider/distance.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <limits>
#include <stdexcept>
#include <variant>

#include "collider/contact/shape_data.h"
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
PlacedShape after(const PlacedShape& body, double fraction) {
    const glm::dvec3 turned = fraction * glm::dvec3(body.motion.rotation);
    const double angle = glm::length(turned);
    glm::dquat rotation(body.pose.rotation);
    if (angle > 0) rotation = glm::angleAxis(angle, turned / angle) * rotation;
    const glm::dvec3 position = glm::dvec3(body.pose.position) + fraction * glm::dvec3(body.motion.displacement);
    return {body.shape, {glm::vec3(position), glm::quat(glm::normalize(rotation))}, body.scale};
}

/// What the search must know of a body.
struct Extent {
    double radius = 0;  ///< the largest distance of a point from the pose position [m]
    double size = 0;    ///< the longest side of the bounds [m]; 0 for planes and sheets
    double voxel = std::numeric_limits<double>::infinity();  ///< of the field, if it has one [m]
};

Extent extentOf(const Collider& collider, double scale) {
    const Bounds& bounds = collider.bounds();
    return {scale * glm::length(glm::dvec3(glm::max(glm::abs(bounds.lower), glm::abs(bounds.upper)))),
            scale * double(bounds.longestSide()), scale * double(collider.field().voxelSize())};
}

Extent extentOf(const Convex& convex, double scale) {
    double radius = 0;
    const auto vertices = convex.vertices();
    for (std::uint32_t i = 0; i < vertices.size(); ++i)
        radius = std::max(radius, double(glm::length(vertices[i]) + convex.radius(i)));
    return {scale * radius, 2 * scale * radius};
}

Extent extentOf(const PlacedShape& body) {
    const auto& shape = body.shape.data().shape;
    const auto scale = double(body.scale);
    if (const auto* collider = std::get_if<Collider>(&shape)) return extentOf(*collider, scale);
    if (const auto* convex = std::get_if<Convex>(&shape)) return extentOf(*convex, scale);
    if (body.motion.rotation != glm::vec3(0))
        throw std::invalid_argument("a plane or a sheet of triangles has no end, and must not rotate");
    return {};
}

double toleranceFor(const Extent& a, const Extent& b, float asked) {
    const double wanted = asked > 0 ? double(asked) : defaultTolerance * std::min(a.voxel, b.voxel);
    return std::max(wanted, minTolerance * std::max(a.size, b.size));
}

}  // namespace

Impact timeOfImpact(const PlacedShape& a, const PlacedShape& b, const ImpactOptions& options) {
    check(a.motion);
    check(b.motion);
    const Extent ofA = extentOf(a), ofB = extentOf(b);
    const double tolerance = toleranceFor(ofA, ofB, options.tolerance);
    const auto rotationOf = [](const PlacedShape& body, const Extent& extent) {
        return glm::length(glm::dvec3(body.motion.rotation)) * extent.radius;
    };
    // no two points approach by more in the whole motion
    const double approach = glm::distance(glm::dvec3(a.motion.displacement), glm::dvec3(b.motion.displacement)) +
                            rotationOf(a, ofA) + rotationOf(b, ofB);
    DistanceStart start;
    for (double fraction = 0; fraction <= 1;) {
        const PlacedShape nowA = after(a, fraction), nowB = after(b, fraction);
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

Impact timeOfImpact(const Placed& a, const Placed& b, const ImpactOptions& options) {
    const auto shapeOf = [](const Placed& body) {
        return PlacedShape{ContactShape(body.collider), body.pose, body.scale, body.motion};
    };
    return timeOfImpact(shapeOf(a), shapeOf(b), options);
}

}  // namespace bilayer
