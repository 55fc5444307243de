// SPDX-License-Identifier: Apache-2.0
// Tested by tests/collider/time_of_impact.cpp through timeOfImpact().
#include <bilayer/collider/distance.h>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>
#include <variant>

#include "collider/contact/body/body_transform.h"
#include "collider/contact/impact/advancement.h"
#include "collider/contact/impact/penetration.h"
#include "collider/contact/shapes/placed_shapes.h"
#include "collider/contact/shapes/shape_data.h"
#include "sdf/base/access.h"
#include "sdf/base/finite.h"

namespace bilayer {

using namespace detail;

namespace {

/// The default tolerance [voxels], and the minimum of any tolerance [sizes of the larger body].
constexpr double defaultTolerance = 0.05, minTolerance = 1e-5;
/// Max count of distances in a search. Bodies that slide past each other at hardly more than the tolerance need one for
/// each separation that they travel.
constexpr int maxDistances = 10000;
/// A body that rotates by more has no motion of one step [rad].
constexpr float maxMotionRotation = 1000;

// The name of the motion begins errors: "motion a".
void requireFinite(const Motion& motion, const std::string& name) {
    if (!isFinite(motion.displacement) || !isFinite(motion.rotation))
        throw std::invalid_argument(fmt::format("{} must be finite, not {}, {}, {} and {}, {}, {} rad", name,
                                                motion.displacement.x, motion.displacement.y, motion.displacement.z,
                                                motion.rotation.x, motion.rotation.y, motion.rotation.z));
    if (glm::length(glm::dvec3(motion.rotation)) > maxMotionRotation)
        throw std::invalid_argument(fmt::format("{} rotates by {:g} rad; at most {:g} rad are allowed", name,
                                                glm::length(motion.rotation), maxMotionRotation));
}

/// What the search must know of a body.
struct Extent {
    double radius = 0;  ///< the largest distance of a point from the pose position [m]
    double size = 0;    ///< the longest side of the bounds [m]; 0 for planes and open surfaces
    double voxel = std::numeric_limits<double>::infinity();  ///< of the field, if it has one [m]
};

Extent extentOf(const Placed& body) {
    const Bounds& bounds = body.collider.bounds();
    const auto scale = double(body.scale);
    return {scale * glm::length(glm::dvec3(glm::max(glm::abs(bounds.lower), glm::abs(bounds.upper)))), lengthOf(body),
            scale * double(body.collider.field().voxelSize())};
}

Extent extentOf(const Convex& convex, double scale) {
    const double radius = scale * convex.boundingRadius();
    return {radius, 2 * radius};
}

Extent extentOf(const PlacedShape& body, const std::string& motion) {
    const auto& shape = dataOf(body.shape).shape;
    if (body.shape.collider()) return extentOf(placed(body));
    if (const auto* convex = std::get_if<Convex>(&shape)) return extentOf(*convex, double(body.scale));
    if (body.motion.rotation != glm::vec3(0))
        throw std::invalid_argument(motion + " must not rotate: a plane or an open surface has no radius");
    return {};
}

double toleranceFor(const Extent& a, const Extent& b, float asked) {
    const double wanted = asked > 0 ? double(asked) : defaultTolerance * std::min(a.voxel, b.voxel);
    return std::max(wanted, minTolerance * std::max(a.size, b.size));
}

/// A body and its motion.
struct MovingBody {
    const PlacedShape& body;
    std::string motion;  ///< its name in errors
    Sweep sweep;

    MovingBody(const PlacedShape& placed, std::string name)
        : body(placed), motion(std::move(name)), sweep(placed.pose, placed.motion) {
        requireFinite(placed.motion, motion);
    }
    PlacedShape at(double fraction) const { return {body.shape, sweep.at(fraction), body.scale}; }
    SweptShape swept() const { return {body.shape, sweep, {}, body.scale}; }
};

Impact timeOfTouch(const MovingBody& a, const MovingBody& b, float askedTolerance) {
    const Extent ofA = extentOf(a.body, a.motion), ofB = extentOf(b.body, b.motion);
    const double tolerance = toleranceFor(ofA, ofB, askedTolerance);
    const double approach = maxApproach(a.sweep, ofA.radius, b.sweep, ofB.radius);
    const auto fractionAt = [&](double travelled) { return approach > 0 ? travelled / approach : 0; };
    BodyDistance separation;
    DistanceStart start;
    const auto clearanceAt = [&](double travelled) {
        const double fraction = fractionAt(travelled);
        const auto limit = float(approach - travelled + tolerance);
        separation = distance(a.at(fraction), b.at(fraction), {.maxDistance = limit}, &start);
        if (!separation.found) return std::numeric_limits<double>::infinity();
        return separation.overlap == Overlap::none ? double(separation.distance) : 0;
    };
    // half of the tolerance is left, so that the bodies come near, and never touch
    const auto touch = firstNear(approach, tolerance, 0.5 * tolerance, maxDistances, clearanceAt);
    if (!touch) return {};
    const double fraction = fractionAt(*touch);
    return {true, float(fraction), a.sweep.at(fraction), b.sweep.at(fraction), separation};
}

Impact penetration(const MovingBody& a, const MovingBody& b) {
    const Penetration first = firstPenetration(a.swept(), b.swept());
    if (!first.found()) return {};
    const auto fraction = double(first.time);
    const BodyDistance place{
        .found = true, .distance = 0, .a = {first.position}, .b = {first.position}, .normal = first.normal};
    return {true, first.time, a.sweep.at(fraction), b.sweep.at(fraction), place};
}

}  // namespace

Impact timeOfImpact(const PlacedShape& a, const PlacedShape& b, const ImpactOptions& options) {
    orderOf(a, b);
    const MovingBody movingA(a, "motion a"), movingB(b, "motion b");
    return options.penetration ? penetration(movingA, movingB) : timeOfTouch(movingA, movingB, options.tolerance);
}

Impact timeOfImpact(const Placed& a, const Placed& b, const ImpactOptions& options) {
    const auto shapeOf = [](const Placed& body) {
        return PlacedShape{ContactShape(body.collider), body.pose, body.scale, body.motion};
    };
    return timeOfImpact(shapeOf(a), shapeOf(b), options);
}

}  // namespace bilayer
