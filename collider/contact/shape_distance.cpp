// SPDX-License-Identifier: Apache-2.0
// The distance between two shapes, one of them a collider.
// Tested by tests/collider/shape_distance.cpp through distance().
#include <bilayer/collider/distance.h>

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <variant>
#include <vector>

#include "collider/contact/body/body_transform.h"
#include "collider/contact/body/collider_data.h"
#include "collider/contact/distance/body_distance.h"
#include "collider/contact/distance/solid_distance.h"
#include "collider/contact/shapes/placed_shapes.h"
#include "collider/contact/shapes/shape_data.h"
#include "sdf/base/access.h"

namespace bilayer {

using namespace detail;

namespace {

/// A shape A and a collider B, where they are: motions are left out.
struct ShapeAndCollider {
    PlacedShape a, shapeOfB;
    Placed b;
    Similarity bToWorld, aToB;

    ShapeAndCollider(const PlacedShape& a, const PlacedShape& b)
        : a{a.shape, a.pose, a.scale},
          shapeOfB{b.shape, b.pose, b.scale},
          b(placed(shapeOfB)),
          bToWorld(toWorld(b.pose, b.scale)),
          aToB(toWorld(a.pose, a.scale).into(bToWorld)) {}

    const MeshTree& mesh() const { return dataOf(b.collider).meshTree(); }
};

BodyDistance separated(const ShapeAndCollider& bodies, const SolidDistance& found) {
    const double distance = found.distance * bodies.bToWorld.scale;
    BodyDistance answer{.found = true,
                        .distance = float(distance),
                        .a = {bodies.bToWorld(found.onSolid)},
                        .b = witness(bodies.bToWorld, found.onMesh, found.triangle)};
    const glm::dvec3 fromB = found.onSolid - found.onMesh.position;
    if (const double length = glm::length(fromB); distance > 0 && length > 0)
        answer.normal = bodies.bToWorld.rotation * (fromB / length);
    return answer;
}

/// Of the larger body, if the shape has a size [m].
double lengthOf(const ShapeAndCollider& bodies) {
    const auto* convex = std::get_if<Convex>(&dataOf(bodies.a.shape).shape);
    const double ofShape = convex ? 2 * double(bodies.a.scale) * convex->boundingRadius() : 0;
    return std::max(ofShape, detail::lengthOf(bodies.b));
}

/// Keeps the deeper of two answers.
void take(BodyDistance& deepest, const BodyDistance& other) {
    if (other.distance < deepest.distance) deepest = other;
}

/// The deepest contact of collide(); nothing found if there is none.
BodyDistance deepestContact(const ShapeAndCollider& bodies) {
    std::vector<Contact> contacts;
    collide(bodies.a, bodies.shapeOfB, {.exact = true}, contacts);
    BodyDistance deepest;
    for (const Contact& contact : contacts)
        take(deepest, {.found = true,
                       .overlap = Overlap::surfaces,
                       .distance = contact.distance,
                       .a = {contact.position + contact.distance * contact.normal},
                       .b = {contact.position},
                       .normal = contact.normal});
    return deepest;
}

/// The vertex of a convex body that is deepest in the collider.
BodyDistance deepestVertex(const ShapeAndCollider& bodies, const Convex& convex) {
    const Field& field = bodies.b.collider.exactField();
    BodyDistance deepest;
    const auto vertices = convex.vertices();
    for (std::uint32_t i = 0; i < vertices.size(); ++i) {
        const glm::dvec3 vertex = bodies.aToB(glm::dvec3(vertices[i]));
        const ClosestPoint closest = field.closest(glm::vec3(vertex));
        if (!closest.found || closest.distance >= 0) continue;
        const glm::vec3 normal = bodies.b.pose.rotation * closest.normal;
        const float radius = convex.radius(i) * bodies.a.scale;
        take(deepest,
             {.found = true,
              .overlap = Overlap::surfaces,
              .distance = closest.distance * bodies.b.scale - radius,
              .a = {glm::vec3(bodies.bToWorld(vertex)) - radius * normal},
              .b = {bodies.bToWorld(glm::dvec3(closest.position)), closest.triangle, closest.feature, closest.index},
              .normal = normal});
    }
    return deepest;
}

/// The vertex of the mesh that is deepest in a convex body, and whether all of them are inside.
struct DeepestOfMesh {
    BodyDistance deepest;
    bool isAllInside = true;
};

DeepestOfMesh deepestOfMesh(const ShapeAndCollider& bodies, const Convex& convex) {
    DeepestOfMesh result;
    const Similarity bToA = bodies.aToB.inverted();
    for (const glm::vec3& point : bodies.b.collider.mesh().points) {
        const NearestPoint nearest = convex.nearest(glm::vec3(bToA(glm::dvec3(point))), 0);
        result.isAllInside &= nearest.distance < 0;
        if (!(nearest.distance < 0)) continue;
        const glm::vec3 outward = bodies.a.pose.rotation * nearest.normal;
        const float depth = nearest.distance * bodies.a.scale;
        const glm::vec3 place(bodies.bToWorld(glm::dvec3(point)));
        take(result.deepest, {.found = true,
                              .overlap = Overlap::surfaces,
                              .distance = depth,
                              .a = {place - depth * outward},
                              .b = {place},
                              .normal = -outward});
    }
    return result;
}

/// The answer where the surfaces meet, or one body lies inside the other.
BodyDistance overlapping(const ShapeAndCollider& bodies, const Convex& convex, const SolidDistance& touch,
                         bool isInsideB) {
    const DeepestOfMesh ofMesh = isInsideB ? DeepestOfMesh{{}, false} : deepestOfMesh(bodies, convex);
    BodyDistance deepest = ofMesh.deepest;
    if (ofMesh.isAllInside) {
        deepest.overlap = Overlap::bInsideA;
        return deepest;
    }
    take(deepest, deepestContact(bodies));
    take(deepest, deepestVertex(bodies, convex));
    if (!(deepest.distance < 0) && touch.found()) deepest = separated(bodies, touch);
    deepest.found = true;
    deepest.overlap = isInsideB ? Overlap::aInsideB : Overlap::surfaces;
    return deepest;
}

BodyDistance distanceOf(const Convex& convex, const ShapeAndCollider& bodies, double limit, DistanceStart& start) {
    const SolidDistance found = nearestTo(convex, bodies.mesh(), bodies.aToB, limit, start.triangleB);
    start.triangleB = found.triangle;
    if (found.found() && !(found.distance > 0)) return overlapping(bodies, convex, found, false);
    const glm::vec3 within(bodies.aToB(glm::dvec3(convex.vertices().front())));
    if (bodies.b.collider.exactField().inside(within)) return overlapping(bodies, convex, found, true);
    return found.found() ? separated(bodies, found) : BodyDistance{};
}

BodyDistance distanceOf(const HalfSpace& solid, const ShapeAndCollider& bodies, double limit, DistanceStart& start) {
    const SolidDistance found = nearestTo(solid, bodies.mesh(), bodies.aToB, limit, start.triangleB);
    start.triangleB = found.triangle;
    if (!found.found()) return {};
    BodyDistance answer = separated(bodies, found);
    answer.normal = -(bodies.a.pose.rotation * solid.normal);
    if (found.distance < 0) {
        const HalfSpace reversed{-solid.normal, -solid.offset};
        const SolidDistance highest =
            nearestTo(reversed, bodies.mesh(), bodies.aToB, std::numeric_limits<double>::infinity(), noTriangle);
        answer.overlap = highest.distance > 0 ? Overlap::bInsideA : Overlap::surfaces;
    }
    return answer;
}

/// Asks for triangles in boxes that grow until the nearest one must be among them.
BodyDistance distanceOf(const OpenSurface& openSurface, const ShapeAndCollider& bodies, double limit,
                        DistanceStart& start) {
    constexpr float maxReach = 1e30f;
    const double scale = bodies.aToB.scale;
    const BodyTransform intoOpenSurface(bodies.b.pose, bodies.b.scale, bodies.a.pose, bodies.a.scale);
    SolidDistance best;
    best.distance = limit;
    const auto search = [&](float reach) {
        openSurface.visit(intoOpenSurface.boxAround(bodies.b.collider.bounds(), reach), [&](const Triangle& triangle,
                                                                                            std::uint64_t) {
            if (!(best.distance > 0)) return;
            const SolidDistance found = nearestTo(triangle, bodies.mesh(), bodies.aToB, best.distance, start.triangleB);
            if (found.found() && found.distance < best.distance) best = found;
        });
    };
    const double size = glm::length(glm::dvec3(bodies.b.collider.bounds().size())) / scale;
    for (double reach = 0.1 * size;; reach *= 4) {
        const bool isLast = reach * scale >= best.distance || reach > double(maxReach);
        search(float(isLast ? std::min(best.distance / scale, double(maxReach)) : reach));
        if (isLast || best.distance <= reach * scale) break;
    }
    start.triangleB = best.triangle;
    if (!best.found()) return {};
    if (best.distance > 0) return separated(bodies, best);
    BodyDistance deepest = deepestContact(bodies);
    if (!deepest.found) deepest = separated(bodies, best);
    deepest.overlap = Overlap::surfaces;
    return deepest;
}

}  // namespace

BodyDistance distance(const PlacedShape& a, const PlacedShape& b, const DistanceOptions& options,
                      DistanceStart* start) {
    const Order order = orderOf(a, b);
    if (order.both) return distance(placed(a), placed(b), options, start);
    const ShapeAndCollider bodies(order.isSwapped ? b : a, order.isSwapped ? a : b);
    const double limit = searchLimit(options, lengthOf(bodies)) / double(bodies.b.scale);
    DistanceStart own;
    if (start) own.triangleB = order.isSwapped ? start->triangleA : start->triangleB;
    const auto& shape = dataOf(bodies.a.shape).shape;
    BodyDistance answer;
    if (const auto* convex = std::get_if<Convex>(&shape))
        answer = distanceOf(*convex, bodies, limit, own);
    else if (const auto* solid = std::get_if<HalfSpace>(&shape))
        answer = distanceOf(*solid, bodies, limit, own);
    else
        answer = distanceOf(std::get<OpenSurface>(shape), bodies, limit, own);
    if (start)
        *start = order.isSwapped ? DistanceStart{own.triangleB, noTriangle} : DistanceStart{noTriangle, own.triangleB};
    return order.isSwapped ? swapped(answer) : answer;
}

}  // namespace bilayer
