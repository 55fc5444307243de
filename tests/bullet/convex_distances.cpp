// SPDX-License-Identifier: Apache-2.0
// Contact tests between a field and convex shapes return the distance between the shape and the triangles.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <functional>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <limits>

#include "integration/bullet/detail/convert.h"
#include "tests/bullet/field_and_mesh.h"
#include "tests/bullet/world.h"
#include "tests/support/support.h"

namespace bilayer::convex_distances_test {
using namespace bilayer::detail;
using namespace bilayer::bullet::detail;
using namespace bilayer::test;
using bullet::detail::toBullet;

namespace {

// The minimum of a convex function between two places, by golden-section search.
double minBetween(const glm::dvec3& from, const glm::dvec3& to,
                  const std::function<double(const glm::dvec3&)>& function) {
    constexpr double golden = 0.6180339887498949;
    const auto at = [&](double part) { return function(glm::mix(from, to, part)); };
    double lower = 0, upper = 1, left = 1 - golden, right = golden, onLeft = at(left), onRight = at(right);
    for (int i = 0; i < 24; ++i)
        if (onLeft < onRight) {
            upper = right, right = left, onRight = onLeft;
            onLeft = at(left = upper - golden * (upper - lower));
        } else {
            lower = left, left = right, onLeft = onRight;
            onRight = at(right = lower + golden * (upper - lower));
        }
    return std::min({at(0), at(1), onLeft, onRight});
}

// Distance from a point to the box of shapeOf(1, 1), whose corners Bullet rounds off.
double fromBox(const glm::dvec3& p) {
    const glm::dvec3 beyond = glm::abs(p) - glm::dvec3(0.1, 0.15, 0.2);
    return glm::length(glm::max(beyond, 0.)) + std::min(std::max({beyond.x, beyond.y, beyond.z}), 0.);
}

// Distance from a point to the cylinder of shapeOf(3, 1).
double fromCylinder(const glm::dvec3& p) {
    const glm::dvec2 beyond(std::hypot(p.x, p.z) - 0.1, std::abs(p.y) - 0.2);
    return glm::length(glm::max(beyond, 0.)) + std::min(std::max(beyond.x, beyond.y), 0.);
}

// Distance from a point to the cone of shapeOf(4, 1), which its margin rounds off.
double fromCone(const glm::dvec3& p) {
    const glm::dvec2 at(std::hypot(p.x, p.z), p.y), apex(0, 0.15), rim(0.12, -0.15), side = rim - apex;
    const double part = std::clamp(glm::dot(at - apex, side) / glm::dot(side, side), 0., 1.);
    const double toSide = glm::distance(at, apex + part * side), above = -0.15 - at.y,
                 beyond = (side.x * (at.y - apex.y) - side.y * (at.x - apex.x)) / glm::length(side);
    const bool isInside = above <= 0 && beyond <= 0;
    const double toBase = std::hypot(std::max(at.x - rim.x, 0.), above);
    return (isInside ? std::max(above, beyond) : std::min(toSide, toBase)) - 0.01;
}

// Distance between triangles and a convex solid, in the solid's coordinates. Bullet's own search rounds off a
// cylinder's rims, and stops up to 0.1 voxels before it has found the nearest place of a triangle.
double distanceTo(const Mesh& mesh, double ofPoint(const glm::dvec3&)) {
    double least = std::numeric_limits<double>::max();
    for (const glm::uvec3& t : mesh.triangles) {
        const glm::dvec3 a = mesh.points[t.x], b = mesh.points[t.y], c = mesh.points[t.z];
        if (ofPoint(a) - std::max(glm::distance(a, b), glm::distance(a, c)) >= least) continue;
        const auto ofLine = [&](const glm::dvec3& p) { return minBetween(a, p, ofPoint); };
        least = std::min(least, minBetween(b, c, ofLine));
    }
    return least;
}

}  // namespace

TEST_CASE("Contact tests between a field and convex shapes return the distance to the triangles") {
    const int kind = GENERATE(range(0, 7));
    const float scale = GENERATE(0.01f, 1.f, 100.f);
    // with the first two seeds, the nearest places lie between surface points that are outside the margin
    const unsigned start = GENERATE(28u, 116239924u, seed());
    CAPTURE(kind, scale, start);
    FieldAndMesh both(bodyOf(kind % 2 ? 2 : 0), scale, false, 1);
    // a ring of four voxels' radius: for thinner ones the interpolation error reaches 0.1 voxels
    const Mesh mesh = bodyOf(kind % 2 ? 2 : 0);
    const auto shape = shapeOf(kind, scale), itsShape = shapeOf(kind, 1);
    Directions random(start);
    btRigidBody* ofField = both.ofField.add(*shape, 1, {0, 0, 0});
    btRigidBody* ofTriangles = both.ofTriangles.add(*itsShape, 1, {0, 0, 0});
    int found = 0;
    const float maxDistance = 0.1f;
    for (int i = 0; i < 100; ++i) {
        const btTransform rotation(random.rotation());
        const btVector3 place = 0.9f * random.vector() + btVector3(0.3f, -0.2f, 0.1f);
        const auto ask = [&](World& world, btRigidBody* body, float factor) {
            body->setWorldTransform(btTransform(rotation.getBasis(), factor * place));
            Nearest nearest;
            nearest.m_closestDistanceThreshold = factor * maxDistance;
            world.dynamics.contactPairTest(world.dynamics.getCollisionObjectArray()[0], body, nearest);
            return nearest.distance / factor;
        };
        // triangles give no penetration depth of a solid
        const auto body = both.ofTriangles.dynamics.getCollisionObjectArray()[0]->getWorldTransform();
        const float distance = ask(both.ofField, ofField, scale), byBullet = ask(both.ofTriangles, ofTriangles, 1);
        Mesh seen = mesh;
        for (glm::vec3& p : seen.points)
            p = bullet::detail::toGlm(btTransform(rotation.getBasis(), place).inverse() * (body * toBullet(p)));
        const float expected = kind == 1   ? float(distanceTo(seen, fromBox))
                               : kind == 3 ? float(distanceTo(seen, fromCylinder))
                               : kind == 4 ? float(distanceTo(seen, fromCone))
                                           : byBullet;
        CAPTURE(i, distance / voxel, expected / voxel, byBullet / voxel);
        if (windingNumber(mesh, glm::dvec3(bullet::detail::toGlm(body.invXform(place)))) > 0.5) continue;
        if (expected < 0.1f * voxel || expected > 0.9f * maxDistance) continue;
        ++found;
        CHECK(distance == Approx(expected).margin(0.1 * double(voxel)));
    }
    CHECK(found > 0);
}
}  // namespace bilayer::convex_distances_test
