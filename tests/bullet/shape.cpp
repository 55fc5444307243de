// SPDX-License-Identifier: Apache-2.0
// Queries of a field's shape between steps: rays, sweeps, contact tests, inertia; and arguments that it rejects.
#include <BulletCollision/CollisionDispatch/btCollisionWorld.h>
#include <BulletCollision/NarrowPhaseCollision/btRaycastCallback.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include <bilayer/sdf/build.h>
#include "demos/shared/shapes.h"
#include "tests/bullet/world.h"

namespace bilayer::shape_test {
using namespace bilayer::test;
using bullet::Shape;

namespace {

constexpr float h = 0.05f;  // voxel [m]

// On a sphere of radius R, the gradient of the trilinear interpolant is off by up to h / (2 R) along either tangent.
// The deepest place of a ball is found with that lateral error.
constexpr float fieldRadius = 0.5f;
const float minCosine = std::cos(h / fieldRadius);
constexpr double depthError = 0.1 * h;

struct Contacts : btCollisionWorld::ContactResultCallback {
    btScalar addSingleResult(btManifoldPoint& point, const btCollisionObjectWrapper* first, int, int,
                             const btCollisionObjectWrapper*, int, int) override {
        ++count;
        if (point.getDistance() < deepest) {
            deepest = point.getDistance();
            normal = point.m_normalWorldOnB;
            firstObject = first->getCollisionObject();
        }
        return 0;
    }
    int count = 0;
    float deepest = std::numeric_limits<float>::max();
    btVector3 normal{0, 0, 0};
    const btCollisionObject* firstObject = nullptr;
};

}  // namespace

TEST_CASE("Rays meet a field's sphere where the formula says") {
    const float scale = GENERATE(1.f, 3.f);
    const btVector3 centre(0.3f, -0.2f, 0.7f);
    Shape shape(exactSphere(0.6f, h));
    shape.setLocalScaling({scale, scale, scale});
    const float radius = 0.6f * scale;
    World world;
    world.add(shape, 1, centre, btQuaternion(btVector3(1, 2, 3).normalized(), 0.8f));

    int hits = 0;
    for (int i = 0; i < 40; ++i) {
        // around the rim too, so that some miss
        const float offset = radius * i / 35.f;
        const btVector3 from = centre + btVector3(-5, offset, 0.1f), to = from + btVector3(10, 0, 0);
        btCollisionWorld::ClosestRayResultCallback ray(from, to);
        world.dynamics.rayTest(from, to, ray);
        const float square = radius * radius - offset * offset - 0.01f;
        CAPTURE(i, scale);
        // the interpolant of a sphere's distances lies up to h^2 / (4 R) inside
        const float error = scale * h * h / (4 * 0.6f) + 1e-5f;
        if (std::abs(square) < 2 * radius * error) continue;
        REQUIRE(ray.hasHit() == (square > 0));
        if (!ray.hasHit()) continue;
        ++hits;
        const btVector3 exact(centre.x() - std::sqrt(square), from.y(), from.z());
        const btVector3 normal = (exact - centre) / radius;
        CHECK((ray.m_hitPointWorld - exact).length() < error / std::abs(normal.x()) + 1e-4f);
        CHECK(ray.m_hitNormalWorld.dot(normal) > 0.998f);
    }
    CHECK(hits > 30);
}

TEST_CASE("Spheres are swept against the field, or against the mesh where they are wider than the band") {
    const float radius = GENERATE(0.05f, 0.3f);
    CAPTURE(radius);
    Shape shape(exactBox({0.5f, 0.4f, 0.3f}, h));
    World world;
    world.add(shape, 1, {0, 0, 1});
    const btSphereShape sphere(radius);
    const btVector3 from(0.1f, 0.1f, 3), to(0.1f, 0.1f, 1);
    btCollisionWorld::ClosestConvexResultCallback sweep(from, to);
    world.dynamics.convexSweepTest(&sphere, btTransform(btQuaternion::getIdentity(), from),
                                   btTransform(btQuaternion::getIdentity(), to), sweep);
    REQUIRE(sweep.hasHit());
    CHECK(sweep.m_closestHitFraction == Approx((3 - 1.3f - radius) / 2).margin(1e-3));
    CHECK(sweep.m_hitNormalWorld.z() == Approx(1).margin(1e-3));
    CHECK(sweep.m_hitPointWorld.z() == Approx(1.3f).margin(1e-3));

    // next to the box, and away from it
    for (const auto& [a, b] :
         {std::pair(btVector3(0.9f, 0, 3), btVector3(0.9f, 0, -3)), std::pair(from, from + btVector3(0, 0, 1))}) {
        btCollisionWorld::ClosestConvexResultCallback miss(a, b);
        world.dynamics.convexSweepTest(&sphere, btTransform(btQuaternion::getIdentity(), a),
                                       btTransform(btQuaternion::getIdentity(), b), miss);
        CHECK_FALSE(miss.hasHit());
    }
}

TEST_CASE(
    "Spheres of any radius are swept against a body without a mesh, from within its band and from beyond its box") {
    const float scale = GENERATE(1.f, 2.f), radius = GENERATE(0.2f, 1.f, 1.2f, 1.4f, 1.7f, 2.f, 2.5f, 4.f) * scale * h;
    CAPTURE(scale, radius / (scale * h));
    const Mesh mesh = shapes::box({0.5f, 0.4f, 0.3f});
    const LevelSet field = build(mesh, {.voxelSize = h});
    Shape shape(withoutMesh(mesh, field));
    shape.setLocalScaling({scale, scale, scale});
    World world;
    world.add(shape, 1, {0, 0, 0});
    const btSphereShape sphere(radius);
    for (const float height : {0.4f, 0.5f, 0.7f, 2.f}) {
        const btVector3 from(0.1f, 0.1f, scale * (0.3f + height) + radius), to(0.1f, 0.1f, 0);
        btCollisionWorld::ClosestConvexResultCallback sweep(from, to);
        world.dynamics.convexSweepTest(&sphere, btTransform(btQuaternion::getIdentity(), from),
                                       btTransform(btQuaternion::getIdentity(), to), sweep);
        CAPTURE(height);
        REQUIRE(sweep.hasHit());
        CHECK(sweep.m_closestHitFraction * from.z() == Approx(scale * height).margin(0.02 * scale * h));
        CHECK(sweep.m_hitNormalWorld.z() == Approx(1).margin(1e-2));
    }
}

TEST_CASE("A ray from inside a body without a mesh leaves it where it leaves the mesh") {
    const Mesh mesh = shapes::box({0.5f, 0.4f, 0.3f});
    const LevelSet field = build(mesh, {.voxelSize = h});
    Shape ofMesh(std::make_shared<Collider>(mesh, field)), ofField(withoutMesh(mesh, field));
    for (Shape* shape : {&ofMesh, &ofField}) {
        World world;
        world.add(*shape, 0, {0, 0, 0});
        const btVector3 from(0.1f, 0.07f, 0.1f), to(0.1f, 0.07f, 2.1f);
        btCollisionWorld::ClosestRayResultCallback ray(from, to), oneSided(from, to);
        world.dynamics.rayTest(from, to, ray);
        CHECK(ray.hasHit());
        CHECK(ray.m_closestHitFraction == Approx(0.1).margin(1e-3));
        CHECK(ray.m_hitNormalWorld.z() == Approx(-1).margin(1e-3));
        oneSided.m_flags = btTriangleRaycastCallback::kF_FilterBackfaces;
        world.dynamics.rayTest(from, to, oneSided);
        CHECK_FALSE(oneSided.hasHit());
    }
}

TEST_CASE("Meshes of more triangles than Bullet's quantized hierarchy can number are swept against") {
    const Mesh mesh = shapes::box({1, 1, 1}, 420);
    REQUIRE(mesh.triangles.size() > std::size_t(1) << 21);
    Shape shape(
        std::make_shared<Collider>(mesh, build(mesh, {.voxelSize = 0.1f}), ColliderOptions{.pointSpacingVoxels = 4}));
    World world;
    world.add(shape, 0, {0, 0, 0});
    btBoxShape box({0.1f, 0.1f, 0.1f});
    // on all sides, in the middle and near the corners, so that the last triangles are included
    for (int i = 0; i < 6 * 5; ++i) {
        btVector3 side(0, 0, 0), across(0, 0, 0);
        side[i / 10] = i / 5 % 2 ? 1 : -1;
        if (i % 5)
            across[(i / 10 + 1) % 3] = i % 2 ? 0.85f : -0.85f, across[(i / 10 + 2) % 3] = i % 5 > 2 ? 0.85f : -0.85f;
        CAPTURE(i);
        const btTransform from(btQuaternion::getIdentity(), 3 * side + across), to(btQuaternion::getIdentity(), across);
        btCollisionWorld::ClosestConvexResultCallback sweep(from.getOrigin(), to.getOrigin());
        world.dynamics.convexSweepTest(&box, from, to, sweep);
        REQUIRE(sweep.hasHit());
        CHECK(sweep.m_closestHitFraction == Approx(1.9 / 3).margin(2e-3));
    }
}

namespace {

// Ignores hits whose normal points up, like characters that are swept along the ground.
template <class Callback, class Result>
struct Refusing : Callback {
    using Callback::Callback;
    btScalar addSingleResult(Result& result, bool isNormalInWorld) override {
        if (result.m_hitNormalLocal.z() > 0.5f) return 1;
        return Callback::addSingleResult(result, isNormalInWorld);
    }
};

}  // namespace

TEST_CASE("Rays and swept spheres continue behind a hit that their callback ignores") {
    const bool hasMesh = GENERATE(true, false);
    CAPTURE(hasMesh);
    const Mesh mesh = shapes::box({0.5f, 0.4f, 0.3f});
    const LevelSet field = build(mesh, {.voxelSize = h});
    Shape shape(hasMesh ? std::make_shared<Collider>(mesh, field) : withoutMesh(mesh, field));
    World world;
    world.add(shape, 0, {0, 0, 0});
    const double error = hasMesh ? 1e-5 : 0.02;

    const btVector3 above(0.1f, 0.07f, 2), below(0.1f, 0.07f, -2);
    btCollisionWorld::AllHitsRayResultCallback all(above, below);
    world.dynamics.rayTest(above, below, all);
    REQUIRE(all.m_hitFractions.size() == 2);
    CHECK(std::min(all.m_hitFractions[0], all.m_hitFractions[1]) == Approx(0.425).margin(error));
    CHECK(std::max(all.m_hitFractions[0], all.m_hitFractions[1]) == Approx(0.575).margin(error));

    // through the top at 0.5 m and the far side at -0.5 m
    const btVector3 from(0.9f, 0.07f, 0.6f), to(-0.9f, 0.07f, 0);
    Refusing<btCollisionWorld::ClosestRayResultCallback, btCollisionWorld::LocalRayResult> ray(from, to);
    world.dynamics.rayTest(from, to, ray);
    REQUIRE(ray.hasHit());
    CHECK(ray.m_closestHitFraction == Approx(1.4 / 1.8).margin(error));

    const btSphereShape sphere(0.05f);
    Refusing<btCollisionWorld::ClosestConvexResultCallback, btCollisionWorld::LocalConvexResult> sweep(from, to);
    world.dynamics.convexSweepTest(&sphere, btTransform(btQuaternion::getIdentity(), from),
                                   btTransform(btQuaternion::getIdentity(), to), sweep);
    REQUIRE(sweep.hasHit());
    // the zero set has small triangles; a sphere that has passed some of the top hits them from the side
    CHECK(sweep.m_closestHitFraction > 0.25 / 0.6 + 0.01);
    if (hasMesh) CHECK(sweep.m_closestHitFraction == Approx(1.35 / 1.8).margin(0.002));
}

TEST_CASE("A box is swept against the triangles of the mesh") {
    Shape shape(exactBox({0.5f, 0.4f, 0.3f}, h));
    World world;
    world.add(shape, 1, {0, 0, 1});
    btBoxShape box({0.1f, 0.1f, 0.1f});
    const btTransform from(btQuaternion::getIdentity(), {0, 0, 3}), to(btQuaternion::getIdentity(), {0, 0, 1});
    btCollisionWorld::ClosestConvexResultCallback sweep(from.getOrigin(), to.getOrigin());
    world.dynamics.convexSweepTest(&box, from, to, sweep);
    REQUIRE(sweep.hasHit());
    CHECK(sweep.m_closestHitFraction == Approx((3 - 1.3f - 0.1f) / 2).margin(2e-3));
}

TEST_CASE("Contact tests give the depth and the normal from the second body to the first") {
    Shape shape(exactSphere(fieldRadius, h));
    btSphereShape ball(0.3f);
    World world;
    btRigidBody* field = world.add(shape, 1, {0, 0, 0});
    const float gap = GENERATE(-0.05f, 0.02f);
    btRigidBody* other = world.add(ball, 1, {0, 0, 0.8f + gap});
    CAPTURE(gap);

    SECTION("a pair, either way around") {
        const bool fieldFirst = GENERATE(true, false);
        Contacts found;
        world.dynamics.contactPairTest(fieldFirst ? field : other, fieldFirst ? other : field, found);
        REQUIRE(found.count > 0);
        CHECK(found.deepest == Approx(gap).margin(depthError));
        CHECK(found.normal.z() * (found.firstObject == field ? -1 : 1) > minCosine);
    }
    SECTION("one against all") {
        Contacts found;
        world.dynamics.contactTest(other, found);
        REQUIRE(found.count > 0);
        CHECK(found.deepest == Approx(gap).margin(depthError));
    }
    SECTION("up to a distance") {
        other->setWorldTransform(btTransform(btQuaternion::getIdentity(), {0, 0, 0.9f}));
        Contacts found;
        found.m_closestDistanceThreshold = 0.2f;
        world.dynamics.contactPairTest(field, other, found);
        REQUIRE(found.count > 0);
        CHECK(found.deepest == Approx(0.1f).margin(depthError));
    }
    SECTION("inside a compound") {
        btCompoundShape compound;
        compound.addChildShape(btTransform(btQuaternion::getIdentity(), {0, 0, 0.2f}), &shape);
        btRigidBody* body = world.add(compound, 0, {0, 0, -0.2f});
        Contacts found;
        world.dynamics.contactPairTest(other, body, found);
        REQUIRE(found.count > 0);
        CHECK(found.deepest == Approx(gap).margin(depthError));
    }
    CHECK(world.dispatcher.getNumManifolds() == 0);
}

TEST_CASE("Contact tests of two fields return their distance, beyond the band too") {
    Shape one(exactSphere(fieldRadius, h)), two(exactBox({0.4f, 0.3f, 0.2f}, h));
    const float gap = GENERATE(0.02f, 0.08f, 0.1f, 0.2f, 0.28f);
    const bool inCompound = GENERATE(false, true);
    CAPTURE(gap, inCompound);
    World world;
    btCompoundShape compound;
    compound.addChildShape(btTransform::getIdentity(), &one);
    btRigidBody* ball = world.add(inCompound ? static_cast<btCollisionShape&>(compound) : one, 1, {0, 0, 0});
    btRigidBody* box = world.add(two, 1, {0.1f, 0, fieldRadius + 0.2f + gap});
    Contacts found;
    found.m_closestDistanceThreshold = 0.3f;
    world.dynamics.contactPairTest(ball, box, found);
    REQUIRE(found.count > 0);
    CHECK(found.deepest == Approx(gap).margin(depthError));
}

TEST_CASE("Points deeper than the band are counted, not guessed") {
    Shape slab(exactBox({1, 1, 1}, h));
    btConvexHullShape needle;
    needle.setMargin(0);
    for (int i = 0; i < 4; ++i) needle.addPoint({i == 1 ? 0.01f : 0, i == 2 ? 0.01f : 0, i == 3 ? -0.2f : 0});
    World world;
    world.add(slab, 0, {0, 0, -1});
    world.add(needle, 1, {0.3f, 0.3f, -0.6f});
    world.dynamics.performDiscreteCollisionDetection();
    CHECK(world.dispatcher.statistics().beyondBand >= 4);
    CHECK(world.dispatcher.statistics().contactsKept == 0);
}

TEST_CASE("Inertia is that of the solid, about the centre of mass and its principal axes") {
    const float scale = GENERATE(1.f, 0.1f);
    const glm::vec3 half(0.5f, 0.4f, 0.3f);
    Mesh mesh = shapes::box(half);
    for (glm::vec3& point : mesh.points) point = glm::vec3(point.y, point.z, point.x) + glm::vec3(0.7f, 0, -0.2f);
    const auto collider = std::make_shared<Collider>(mesh, build(mesh, {.voxelSize = h}));
    Shape shape(collider, {.frame = bullet::centreOfMassFrame(*collider)});
    shape.setLocalScaling({scale, scale, scale});

    btVector3 inertia;
    shape.calculateLocalInertia(3, inertia);
    const glm::vec3 square = 4.f * half * half * scale * scale;
    // ascending: the moment about the longest side comes first
    CHECK(inertia.x() == Approx(3.f / 12 * (square.y + square.z)).epsilon(1e-4));
    CHECK(inertia.y() == Approx(3.f / 12 * (square.x + square.z)).epsilon(1e-4));
    CHECK(inertia.z() == Approx(3.f / 12 * (square.x + square.y)).epsilon(1e-4));

    btVector3 lower, upper;
    shape.getAabb(btTransform(btQuaternion::getIdentity(), {1, 2, 3}), lower, upper);
    const btVector3 expected = scale * (btVector3(half.x, half.y, half.z) + btVector3(h, h, h));
    CHECK((upper - btVector3(1, 2, 3) - expected).length() < 1e-5f);
    CHECK((lower - btVector3(1, 2, 3) + expected).length() < 1e-5f);
}

TEST_CASE("Invalid arguments are rejected by name") {
    Shape shape(exactSphere(0.3f, h));
    CHECK_THROWS_AS(Shape(nullptr), std::invalid_argument);
    CHECK_THROWS_AS(shape.setLocalScaling({1, 2, 1}), std::invalid_argument);
    CHECK_THROWS_AS(shape.setLocalScaling({0, 0, 0}), std::invalid_argument);
    CHECK_THROWS_AS(shape.setLocalScaling({-1, -1, -1}), std::invalid_argument);
    CHECK_THROWS_AS(shape.setMargin(-1), std::invalid_argument);
}
}  // namespace bilayer::shape_test
