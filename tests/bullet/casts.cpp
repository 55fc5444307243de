// SPDX-License-Identifier: Apache-2.0
// Casts against a field give the results of Bullet's own triangle mesh: rays, shape sweeps, contact tests, and Bullet's
// CCD of fast bodies.
#include <BulletCollision/NarrowPhaseCollision/btRaycastCallback.h>

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <glm/geometric.hpp>

#include <bilayer/sdf/build.h>
#include <bilayer/sdf/vdb_io.h>
#include "collider/contact/body/collider_data.h"
#include "demos/shared/shapes.h"
#include "integration/bullet/detail/convert.h"
#include "sdf/base/access.h"
#include "tests/bullet/field_and_mesh.h"
#include "tests/bullet/world.h"
#include "tests/support/support.h"

namespace bilayer::casts_test {
using namespace bilayer::detail;
using namespace bilayer::bullet::detail;
using namespace bilayer::test;
using bullet::Shape;

namespace {

// Bullet stops a shape this far before contact, at any scale [m].
constexpr float stopsBefore = 1e-3f;

// The first contact of a sphere along its displacement, over all triangles, in double precision. Bisects a brute-force
// distance that decreases until contact.
double firstTouch(const Mesh& mesh, const glm::dvec3& from, const glm::dvec3& to, double radius) {
    double along = 0;
    const double length = glm::distance(from, to);
    for (int i = 0; i < 100000 && along <= length; ++i) {
        const double gap = distance(mesh, from + along / length * (to - from)) - radius;
        if (gap < 1e-9 * length) return along / length;
        along += gap;
    }
    return 2;
}

// The first hit of a ray over all triangles, in double precision (Moller and Trumbore 1997), as a fraction of the
// displacement; 1 if there is none. Triangles are grown by a fraction of their sides.
double firstHit(const Mesh& mesh, const glm::dvec3& from, const glm::dvec3& to, bool oneSided, double grown) {
    double first = 1;
    const glm::dvec3 delta = to - from;
    for (const glm::uvec3& t : mesh.triangles) {
        const glm::dvec3 a = mesh.points[t.x], u = glm::dvec3(mesh.points[t.y]) - a,
                         v = glm::dvec3(mesh.points[t.z]) - a;
        const glm::dvec3 p = glm::cross(delta, v), q = glm::cross(from - a, u);
        const double volume = glm::dot(u, p);
        if (oneSided ? volume <= 0 : volume == 0) continue;
        const double alongU = glm::dot(from - a, p) / volume, alongV = glm::dot(delta, q) / volume;
        if (alongU < -grown || alongV < -grown || alongU + alongV > 1 + grown) continue;
        if (const double part = glm::dot(v, q) / volume; part >= 0) first = std::min(first, part);
    }
    return first;
}

// The distance from the first body of a world to a shape, by a contact test.
float distanceOf(btCollisionShape& shape, const btTransform& place, World& world) {
    btCollisionObject object;
    object.setCollisionShape(&shape);
    object.setWorldTransform(place);
    Nearest nearest;
    nearest.m_closestDistanceThreshold = 0.1f;
    world.dynamics.contactPairTest(world.dynamics.getCollisionObjectArray()[0], &object, nearest);
    return nearest.distance;
}

}  // namespace

TEST_CASE("Rays meet a field where they meet its triangles") {
    const int kind = GENERATE(0, 1);
    const float scale = GENERATE(0.01f, 1.f, 100.f);
    const bool scaledByBullet = GENERATE(false, true);
    const unsigned start = seed();
    CAPTURE(kind, scale, scaledByBullet, start);
    const Mesh mesh = scaled(bodyOf(kind), scale);
    FieldAndMesh both(bodyOf(kind), scale, scaledByBullet, scale);
    Directions random(start);
    int hits = 0, turned = 0;
    for (int i = 0; i < 300; ++i) {
        const auto [from, to] = random.path(scale);
        btCollisionWorld::ClosestRayResultCallback ray(from, to), expected(from, to);
        const bool oneSided = i % 3 == 0;
        if (oneSided) ray.m_flags = expected.m_flags = btTriangleRaycastCallback::kF_FilterBackfaces;
        // every fifth starts inside
        const btVector3 begin = i % 5 ? from : 0.5f * (from + to);
        both.ofField.dynamics.rayTest(begin, to, ray);
        both.ofTriangles.dynamics.rayTest(begin, to, expected);
        CAPTURE(i, ray.m_closestHitFraction, expected.m_closestHitFraction);
        // rays that pass the outline of the mesh within rounding may hit or miss; Bullet grows its triangles
        const btTransform body = both.ofField.dynamics.getCollisionObjectArray()[0]->getWorldTransform();
        const auto exact = [&, to = to](double grown) {
            return firstHit(mesh, glm::dvec3(bullet::detail::toGlm(body.invXform(begin))),
                            glm::dvec3(bullet::detail::toGlm(body.invXform(to))), oneSided, grown);
        };
        CHECK(ray.m_closestHitFraction > exact(1e-5) - 1e-5);
        CHECK(ray.m_closestHitFraction < exact(-1e-5) + 1e-5);
        CHECK(expected.m_closestHitFraction > exact(1e-3) - 1e-4);
        CHECK(expected.m_closestHitFraction < exact(-1e-3) + 1e-4);
        if (!ray.hasHit() || !expected.hasHit()) continue;
        ++hits;
        turned += ray.m_hitNormalWorld.dot(expected.m_hitNormalWorld) < 0.999f;
    }
    CHECK(hits > 100);
    // on an edge the normal of either triangle is valid
    CHECK(turned <= hits / 50);
}

TEST_CASE("Sweeps of shapes of all kinds hit a field where they hit its triangles") {
    const int kind = GENERATE(range(0, 7));
    // powers of two: all values of Bullet's search are rounded alike
    const float scale = GENERATE(1.f / 128, 1.f, 128.f);
    const bool scaledByBullet = GENERATE(false, true);
    const unsigned start = seed();
    CAPTURE(kind, scale, scaledByBullet, start);
    // Bullet's own search is inaccurate for small bodies; its result at the scale of 1 m is the reference at any scale
    FieldAndMesh both(bodyOf(kind % 2), scale, scaledByBullet, 1);
    const auto shape = shapeOf(kind, scale), itsShape = shapeOf(kind, 1);
    Directions random(start);
    int hits = 0, turned = 0;
    for (int i = 0; i < 60; ++i) {
        const auto [itsFrom, itsTo] = random.path(1);
        const btVector3 from = scale * itsFrom, to = scale * itsTo;
        const btTransform rotation(random.rotation());
        const auto at = [&](const btVector3& place) { return btTransform(rotation.getBasis(), place); };
        btCollisionWorld::ClosestConvexResultCallback sweep(from, to), expected(itsFrom, itsTo);
        both.ofField.dynamics.convexSweepTest(shape.get(), at(from), at(to), sweep);
        both.ofTriangles.dynamics.convexSweepTest(itsShape.get(), at(itsFrom), at(itsTo), expected);
        CAPTURE(i, sweep.m_closestHitFraction, expected.m_closestHitFraction);
        if (kind == 0) {
            // spheres are exact; Bullet's own search stops a millimetre early, or where it does not converge
            const btTransform body = both.ofField.dynamics.getCollisionObjectArray()[0]->getWorldTransform();
            const double exact =
                firstTouch(scaled(bodyOf(kind % 2), scale), glm::dvec3(bullet::detail::toGlm(body.invXform(from))),
                           glm::dvec3(bullet::detail::toGlm(body.invXform(to))), 0.12 * double(scale));
            if (std::abs(exact - 1) < 1e-4) continue;
            REQUIRE(sweep.hasHit() == (exact <= 1));
            if (!sweep.hasHit()) continue;
            ++hits;
            CHECK(sweep.m_closestHitFraction == Approx(exact).margin(1e-4));
        } else {
            // Either search ends within a millimetre of contact, at the scale of 1. They may differ by more, for
            // example where a shape grazes the surface. Then ours must be as near to the triangles, and must not have
            // penetrated them after Bullet's hit.
            const float ours = sweep.hasHit() ? sweep.m_closestHitFraction : 1;
            const float bullets = expected.hasHit() ? expected.m_closestHitFraction : 1;
            const float apart = itsFrom.distance(itsTo) * (ours - bullets);
            if (!sweep.hasHit() && !expected.hasHit()) continue;
            if (sweep.hasHit() && expected.hasHit()) {
                ++hits;
                turned += sweep.m_hitNormalWorld.dot(expected.m_hitNormalWorld) < 0.99f;
                const float down = -expected.m_hitNormalWorld.dot((itsTo - itsFrom).normalized());
                if (std::abs(apart) * std::max(down, 0.05f) < stopsBefore) continue;
            }
            const auto gapAt = [&, itsFrom = itsFrom, itsTo = itsTo](float fraction) {
                return distanceOf(*itsShape, at(itsFrom.lerp(itsTo, fraction)), both.ofTriangles);
            };
            if (sweep.hasHit()) CHECK(gapAt(ours) < stopsBefore);
            if (ours <= bullets) continue;
            for (const float part : {0.f, 0.25f, 0.5f, 0.75f, 1.f})
                CHECK(gapAt(bullets + part * (ours - bullets)) > -stopsBefore / 10);
        }
    }
    CHECK(hits > 15);
    // where a shape touches two triangles at once, their order determines which normal Bullet returns
    CHECK(turned <= hits / 20);
}

TEST_CASE("A body from a file answers casts and contact tests as the one of its mesh, to the bit") {
    const int kind = GENERATE(range(0, 7));
    const unsigned start = seed();
    CAPTURE(kind, start);
    const Mesh mesh = bodyOf(kind % 2);
    const LevelSet field = build(mesh, {.voxelSize = voxel});
    const auto path = scratch("casts.vdb");
    const auto made = std::make_shared<Collider>(mesh, field);
    writeVdb(path, withBody(field, dataOf(*made).body));
    Shape ofMesh(made), ofFile(std::make_shared<Collider>(readVdb(path)));
    World meshes, files;
    meshes.add(ofMesh, 0, {0, 0, 0});
    files.add(ofFile, 0, {0, 0, 0});
    const auto shape = shapeOf(kind, 1);
    Directions random(start);
    int hits = 0, touches = 0;
    for (int i = 0; i < 60; ++i) {
        const auto [from, to] = random.path(1);
        const btTransform begin(random.rotation(), from), end(begin.getBasis(), to),
            near(random.rotation(), 0.8f * random.vector());
        const auto ask = [&, from = from, to = to](World& world) {
            btCollisionWorld::ClosestRayResultCallback ray(from, to);
            world.dynamics.rayTest(from, to, ray);
            btCollisionWorld::ClosestConvexResultCallback sweep(from, to);
            world.dynamics.convexSweepTest(shape.get(), begin, end, sweep);
            return std::array{ray.m_closestHitFraction, sweep.m_closestHitFraction, distanceOf(*shape, near, world)};
        };
        const auto expected = ask(meshes);
        CAPTURE(i);
        REQUIRE(ask(files) == expected);
        hits += expected[0] < 1 && expected[1] < 1;
        touches += expected[2] < 1;
    }
    CHECK(hits > 10);
    CHECK(touches > 0);
}

TEST_CASE("A shape that rotates during a sweep hits what its last rotation does not reach") {
    FieldAndMesh both(bodyOf(0), 1, false, 1);
    const btBoxShape plank({0.02f, 0.02f, 0.9f});
    // upright at the end, horizontal in between
    const btVector3 from(0.3f, 0.75f, 1.5f), to(0.3f, 0.75f, -1.5f);
    const btTransform first(btQuaternion({1, 0, 0}, SIMD_HALF_PI), from), last(btQuaternion({1, 0, 0}, 0), to);
    btCollisionWorld::ClosestConvexResultCallback sweep(from, to);
    both.ofField.dynamics.convexSweepTest(&plank, first, last, sweep);
    CHECK(sweep.hasHit());
}

TEST_CASE("Fast bodies that Bullet follows itself stop at a field as at its triangles") {
    const float speed = GENERATE(20.f, 100.f, 500.f);
    const bool isBox = GENERATE(false, true);
    CAPTURE(speed, isBox);
    const Mesh plate = shapes::box({1, 1, 0.1f});
    const auto play = [&](bool asField) {
        Shape field(std::make_shared<Collider>(plate, build(plate, {.voxelSize = voxel})), {.speculative = false});
        const TriangleShape triangles(plate);
        triangles.shape->setMargin(0);
        World world;
        world.add(asField ? static_cast<btCollisionShape&>(field) : *triangles.shape, 0, {0, 0, 0});
        btSphereShape ball(0.1f);
        btBoxShape box({0.1f, 0.1f, 0.1f});
        btRigidBody* body = world.add(isBox ? static_cast<btCollisionShape&>(box) : ball, 1, {0.2f, 0.1f, 2});
        body->setLinearVelocity({0, 0, -speed});
        body->setCcdMotionThreshold(0.05f);
        body->setCcdSweptSphereRadius(0.08f);
        float lowest = 2;
        for (int i = 0; i < 60; ++i) {
            world.dynamics.stepSimulation(1.f / 60, 1, 1.f / 60);
            lowest = std::min(lowest, float(body->getWorldTransform().getOrigin().z()));
        }
        return std::pair(lowest, float(body->getWorldTransform().getOrigin().z()));
    };
    const auto [lowest, last] = play(true);
    const auto [expectedLowest, expectedLast] = play(false);
    CAPTURE(lowest, last, expectedLowest, expectedLast);
    CHECK(lowest > 0.1f);
    CHECK(last == Approx(expectedLast).margin(0.1 * voxel + stopsBefore));
}
}  // namespace bilayer::casts_test
