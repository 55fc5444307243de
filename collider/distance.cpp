// SPDX-License-Identifier: Apache-2.0
#include <bilayer/collider/distance.h>

#include <algorithm>
#include <glm/geometric.hpp>
#include <utility>

#include "collider/contact/body/body_transform.h"
#include "collider/contact/body/collider_data.h"
#include "collider/contact/distance/body_distance.h"
#include "collider/contact/distance/mesh_distance.h"
#include "collider/contact/shapes/placed_shapes.h"
#include "collider/field/samples/field_data.h"
#include "sdf/base/access.h"

namespace bilayer {

using namespace detail;

namespace {

/// A separation below this defines no direction [sizes of the larger body].
constexpr double minDirection = 1e-7;
/// The refinement of the deepest point: max count of steps, and the first and last distance to the point ahead
/// [voxels].
constexpr int refinements = 40;
constexpr float maxLead = 1024, minLead = 0.01f;

Similarity toWorld(const Placed& body) {
    return detail::toWorld(body.pose, body.scale);
}

/// Two bodies, and the map from coordinates of the first to those of the second.
struct Bodies {
    const Placed &a, &b;
    Similarity aToB;

    Bodies swapped() const { return {b, a, aToB.inverted()}; }
};

/// Of the larger body [m].
double lengthOf(const Bodies& bodies) {
    return std::max(detail::lengthOf(bodies.a), detail::lengthOf(bodies.b));
}

BodyDistance separated(const Bodies& bodies, const MeshDistance& found) {
    const Similarity bToWorld = toWorld(bodies.b);
    const double distance = found.distance * bToWorld.scale;
    BodyDistance answer{.found = true,
                        .distance = float(distance),
                        .a = witness(bToWorld, found.a, found.triangleA),
                        .b = witness(bToWorld, found.b, found.triangleB)};
    if (distance > minDirection * lengthOf(bodies))
        answer.normal = bToWorld.rotation * glm::normalize(found.a.position - found.b.position);
    return answer;
}

// Whether a component of the first body lies inside the second, if their surfaces do not meet.
bool isInside(const Bodies& bodies) {
    const Collider& outer = bodies.b.collider;
    const Bounds& bounds = outer.bounds();
    const auto components = dataOf(bodies.a.collider).componentPoints();
    return std::any_of(components.begin(), components.end(), [&](const glm::vec3& point) {
        const glm::vec3 at(bodies.aToB(glm::dvec3(point)));
        return at == glm::clamp(at, bounds.lower, bounds.upper) && outer.exactField().inside(at);
    });
}

// A point of the first body's surface inside the second, and the closest point of the second's surface; both in
// coordinates of the second.
struct Depth {
    glm::vec3 point{0};
    ClosestPoint closest{.distance = 0};
};

// The deepest of the surface points.
Depth deepestSample(const Bodies& bodies) {
    const Field& field = bodies.b.collider.exactField();
    Depth deepest;
    for (const SurfacePoint& point : dataOf(bodies.a.collider).points().points()) {
        const glm::vec3 at(bodies.aToB(glm::dvec3(point.position)));
        const Sample sample = field.sample(at);
        const bool shallow = sample.inBand && sample.distance > deepest.closest.distance + field.voxelSize();
        if (!(sample.distance < 0) || shallow) continue;
        const ClosestPoint closest = field.closest(at);
        if (closest.found && closest.distance < deepest.closest.distance) deepest = {at, closest};
    }
    return deepest;
}

// Moves the point along the first surface as far as it gets deeper: to where the surface is closest to a point ahead in
// the direction of penetration. A step that does not get deeper divides the distance to that point by four.
Depth refined(Depth depth, const Bodies& bodies) {
    const Field &own = bodies.a.collider.exactField(), &field = bodies.b.collider.exactField();
    const float voxel = field.voxelSize();
    float lead = field.voxelSize() * maxLead;
    for (int i = 0; i < refinements && lead > minLead * voxel; ++i) {
        const glm::vec3 ahead = depth.point - lead * depth.closest.normal;
        const ClosestPoint onSurface = own.closest(glm::vec3(bodies.aToB.inverse(glm::dvec3(ahead))));
        if (!onSurface.found) return depth;
        const glm::vec3 at(bodies.aToB(glm::dvec3(onSurface.position)));
        const ClosestPoint closest = field.closest(at);
        if (closest.found && closest.distance < depth.closest.distance)
            depth = {at, closest};
        else
            lead /= 4;
    }
    return depth;
}

// The deepest surface point of the first body inside the second; at depth 0 if there is none.
BodyDistance deepestOf(const Bodies& bodies) {
    Depth depth = deepestSample(bodies);
    if (depth.closest.distance < 0) depth = refined(depth, bodies);
    const ClosestPoint& closest = depth.closest;
    const Similarity bToWorld = toWorld(bodies.b);
    return {.found = true,
            .overlap = Overlap::surfaces,
            .distance = closest.distance * bodies.b.scale,
            .a = {bToWorld(glm::dvec3(depth.point))},
            .b = {bToWorld(glm::dvec3(closest.position)), closest.triangle, closest.feature, closest.index},
            .normal = bodies.b.pose.rotation * closest.normal};
}

BodyDistance intersecting(const Bodies& bodies, const MeshDistance& touch) {
    const BodyDistance ofA = deepestOf(bodies), ofB = deepestOf(bodies.swapped());
    if (ofA.distance < 0 || ofB.distance < 0) return ofA.distance <= ofB.distance ? ofA : swapped(ofB);
    const Similarity bToWorld = toWorld(bodies.b);
    return {.found = true,
            .overlap = Overlap::surfaces,
            .distance = 0,
            .a = witness(bToWorld, touch.a, touch.triangleA),
            .b = witness(bToWorld, touch.b, touch.triangleB)};
}

BodyDistance contained(BodyDistance deepest, Overlap overlap) {
    deepest.overlap = overlap;
    return deepest;
}

}  // namespace

BodyDistance distance(const Placed& a, const Placed& b, const DistanceOptions& options, DistanceStart* start) {
    for (const Placed* body : {&a, &b}) requireUnitRotation(body->pose);
    const Bodies bodies{a, b, toWorld(a).into(toWorld(b))};
    const double limit = searchLimit(options, lengthOf(bodies)) / double(b.scale);
    const MeshDistance found =
        distanceBetween(dataOf(a.collider).meshTree(), dataOf(b.collider).meshTree(), bodies.aToB, limit,
                        start ? TriangleIndices{start->triangleA, start->triangleB} : TriangleIndices{});
    if (start) *start = {found.triangleA, found.triangleB};
    if (found.found() && found.distance == 0) return intersecting(bodies, found);
    if (isInside(bodies)) return contained(deepestOf(bodies), Overlap::aInsideB);
    const Bodies reversed = bodies.swapped();
    if (isInside(reversed)) return contained(swapped(deepestOf(reversed)), Overlap::bInsideA);
    return found.found() ? separated(bodies, found) : BodyDistance{};
}

}  // namespace bilayer
