// SPDX-License-Identifier: Apache-2.0
// Every pair of shapes comes to rest at the correct height, in either order of insertion.
#include <BulletCollision/CollisionDispatch/btGhostObject.h>
#include <BulletCollision/CollisionShapes/btBox2dShape.h>
#include <BulletCollision/CollisionShapes/btConvexTriangleMeshShape.h>
#include <BulletCollision/CollisionShapes/btHeightfieldTerrainShape.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <glm/trigonometric.hpp>
#include <set>

#include <bilayer/collider/contact.h>
#include <bilayer/sdf/build.h>
#include "collider/contact/open_surface/triangle_contacts.h"
#include "demos/shared/shapes.h"
#include "integration/bullet/detail/contact_shapes.h"
#include "tests/bullet/world.h"

namespace bilayer::pairs_test {
using namespace bilayer::detail;
using namespace bilayer::bullet::detail;
using namespace bilayer::test;
using bullet::Shape;

namespace {

constexpr float h = 0.05f;         // voxel [m]
constexpr float tolerance = 0.1f;  // of rest heights [voxels]

/// Drops `falling` onto `lying` from slightly above, and checks where it comes to rest.
void rests(btCollisionShape& falling, btCollisionShape& lying, const btVector3& lyingAt, const btVector3& expected,
           float scale = 1, bool rolls = false) {
    const bool fallingFirst = GENERATE(false, true);
    CAPTURE(fallingFirst, scale);
    World world;
    const btVector3 start = expected + btVector3(0, 0, scale * h);
    btRigidBody* body = nullptr;
    if (fallingFirst) body = world.add(falling, 2, start);
    world.add(lying, 0, lyingAt);
    if (!fallingFirst) body = world.add(falling, 2, start);
    world.run(2.5f);

    const btTransform& at = body->getWorldTransform();
    CAPTURE(at.getOrigin().x(), at.getOrigin().y(), at.getOrigin().z());
    CHECK(at.getOrigin().z() == Approx(expected.z()).margin(tolerance * scale * h));
    if (!rolls) {
        CHECK(std::hypot(at.getOrigin().x() - expected.x(), at.getOrigin().y() - expected.y()) < scale * h);
        CHECK(at.getBasis()[2][2] > std::cos(glm::radians(1.f)));  // upright; rotation about the vertical is allowed
    }
    CHECK(motion(*body) < 1e-2f);
    CHECK(world.dispatcher.statistics().beyondBand == 0);
}

}  // namespace

TEST_CASE("A field's body rests on each static shape") {
    static const auto box = exactBox({0.5f, 0.4f, 0.3f}, h);
    static const auto sphere = exactSphere(0.4f, h);
    static const auto torus = exactTorus(0.5f, 0.2f, h);
    static const auto slab = exactBox({1.5f, 1.5f, 0.3f}, h);
    const auto [collider, height] = GENERATE(table<int, float>({{0, 0.3f}, {1, 0.4f}, {2, 0.2f}}));
    const bool round = collider == 1;
    CAPTURE(collider);
    Shape body(collider == 0 ? box : collider == 1 ? sphere : torus);

    SECTION("plane") {
        btStaticPlaneShape plane({0, 0, 1}, 0.1f);
        rests(body, plane, {0, 0, -0.1f}, {0, 0, height}, 1, round);
    }
    SECTION("box") {
        btBoxShape flat({3, 3, 0.5f});
        rests(body, flat, {0, 0, -0.5f}, {0, 0, height}, 1, round);
    }
    SECTION("hull") {
        btConvexHullShape flat;
        for (int i = 0; i < 8; ++i) flat.addPoint({i & 1 ? 3.f : -3.f, i & 2 ? 3.f : -3.f, i & 4 ? 0.f : -1.f});
        rests(body, flat, {0, 0, -flat.getMargin()}, {0, 0, height}, 1, round);
    }
    SECTION("cylinder") {
        btCylinderShapeZ flat({2, 2, 0.5f});
        rests(body, flat, {0, 0, -0.5f}, {0, 0, height}, 1, round);
    }
    SECTION("triangle mesh, coarse, scaled") {
        const TriangleShape mesh(shapes::box({1, 1, 0.5f}));
        btScaledBvhTriangleMeshShape scaled(mesh.shape.get(), {2, 2, 1});
        rests(body, scaled, {0, 0, -0.5f}, {0, 0, height}, 1, round);
    }
    SECTION("triangle mesh, fine") {
        const TriangleShape mesh(shapes::box({1.2f, 1.2f, 0.5f}, 40));
        rests(body, *mesh.shape, {0, 0, -0.5f}, {0, 0, height}, 1, round);
    }
    SECTION("height field") {
        const std::vector<float> heights(16 * 16, 0.f);
        btHeightfieldTerrainShape terrain(16, 16, heights.data(), 1, -1, 1, 2, PHY_FLOAT, false);
        terrain.setLocalScaling({0.4f, 0.4f, 1});
        rests(body, terrain, {0, 0, 0}, {0, 0, height}, 1, round);
    }
    SECTION("field") {
        Shape flat(slab);
        rests(body, flat, {0, 0, -0.3f}, {0, 0, height}, 1, round);
    }
    SECTION("field in a compound") {
        Shape flat(slab);
        btCompoundShape compound;
        compound.addChildShape(btTransform(btQuaternion::getIdentity(), {0, 0, -1}), &flat);
        rests(body, compound, {0, 0, 0.7f}, {0, 0, height}, 1, round);
    }
}

TEST_CASE("A box that is resized rests by its new size") {
    static const auto slabCollider = exactBox({1.5f, 1.5f, 0.3f}, h);
    Shape slab(slabCollider);
    btBoxShape box({0.3f, 0.3f, 0.1f});
    World world;
    world.add(slab, 0, {0, 0, -0.3f});
    btRigidBody* body = world.add(box, 1, {0, 0, 0.11f});
    world.run(0.5f);
    const btVector3 half(0.3f, 0.3f, 0.3f);
    box.setImplicitShapeDimensions(half - btVector3(1, 1, 1) * box.getMargin());
    body->setWorldTransform(btTransform(btQuaternion::getIdentity(), {0, 0, 0.35f}));
    body->activate(true);
    world.run(1.5f);
    CHECK(body->getWorldTransform().getOrigin().z() == Approx(0.3).margin(tolerance * h));
}

TEST_CASE("Bullet's flat box stands on its sides, where its margin ends") {
    static const auto slabCollider = exactBox({1.5f, 1.5f, 0.3f}, h);
    Shape slab(slabCollider);
    btBox2dShape box({0.3f, 0.2f, 0.1f});
    World world;
    world.add(slab, 0, {0, 0, -0.3f});
    btRigidBody* body = world.add(box, 1, {0, 0, 0.25f}, btQuaternion({1, 0, 0}, SIMD_HALF_PI));
    body->setAngularFactor(0);  // such shapes are meant for 2D worlds
    world.run(1.5f);
    CHECK(body->getWorldTransform().getOrigin().z() == Approx(0.2).margin(tolerance * h));
}

namespace {

// A wavy ground of cells three voxels wide, as Bullet's height field and as triangles.
struct Waves {
    static constexpr int side = 33;
    static constexpr float cell = 3 * h;

    Waves() {
        for (int i = 0; i < side * side; ++i) {
            const int x = i % side, y = i / side;
            heights.push_back(0.06f * std::sin(0.9f * float(y)) * std::cos(1.1f * float(x)));
            mesh.points.push_back(
                {cell * (float(x) - 0.5f * (side - 1)), cell * (float(y) - 0.5f * (side - 1)), heights[i]});
            if (x == side - 1 || y == side - 1) continue;
            const auto a = std::uint32_t(i);
            mesh.triangles.push_back({a, a + 1, a + 1 + side});
            mesh.triangles.push_back({a, a + 1 + side, a + side});
        }
        terrain =
            std::make_unique<btHeightfieldTerrainShape>(side, side, heights.data(), 1, -1, 1, 2, PHY_FLOAT, false);
        terrain->setLocalScaling({cell, cell, 1});
        terrain->setMargin(0);
        triangles = std::make_unique<TriangleShape>(mesh);
        triangles->shape->setMargin(0);
    }
    btConcaveShape& shape(bool asTerrain) const {
        if (asTerrain) return *terrain;
        return *triangles->shape;
    }

    std::vector<float> heights;
    Mesh mesh;
    std::unique_ptr<btHeightfieldTerrainShape> terrain;
    std::unique_ptr<TriangleShape> triangles;
};

}  // namespace

TEST_CASE("A field comes to rest on uneven ground, where each contact has a feature of its own") {
    const bool asTerrain = GENERATE(false, true);
    const float interiorWidth = GENERATE(5.f, 20.f);
    CAPTURE(asTerrain, interiorWidth);
    const Waves waves;
    const Mesh box = shapes::box({0.5f, 0.4f, 0.1f}, 3);
    Shape shape(std::make_shared<Collider>(box, build(box, {.voxelSize = h, .interiorWidthVoxels = interiorWidth})));
    World world;
    world.dynamics.getSolverInfo().m_solverMode |= SOLVER_USE_2_FRICTION_DIRECTIONS;
    world.dynamics.getSolverInfo().m_splitImpulsePenetrationThreshold = -h;
    world.add(waves.shape(asTerrain), 0, {0, 0, 0});
    btRigidBody* body = world.add(shape, 1, {0.01f, 0.02f, 0.3f});
    body->setFriction(0.8f);
    body->setSleepingThresholds(0.02f, 0.02f);
    world.run(3.5f);
    CHECK_FALSE(body->isActive());

    std::vector<Contact> contacts;
    collideTriangles(bullet::detail::openSurfaceOf(waves.shape(asTerrain)), {}, {},
                     shape.placed(body->getWorldTransform()), {.margin = h}, contacts);
    std::set<std::uint32_t> features;
    for (const Contact& contact : contacts) features.insert(contact.feature);
    CHECK(features.size() == contacts.size());
    CHECK(contacts.size() > 20);
    // a few for each of the ground's 180 triangles below the box, however wide the band
    CHECK(contacts.size() < 1000);
}

TEST_CASE("Each convex shape rests on a field") {
    static const auto slabCollider = exactBox({1.5f, 1.5f, 0.3f}, h);
    Shape slab(slabCollider);
    const btVector3 below(0, 0, -0.3f);

    SECTION("sphere, narrow and wide") {
        const float radius = GENERATE(0.06f, 0.4f);
        btSphereShape sphere(radius);
        rests(sphere, slab, below, {0, 0, radius}, 1, true);
    }
    SECTION("box") {
        btBoxShape box({0.4f, 0.3f, 0.2f});
        rests(box, slab, below, {0, 0, 0.2f});
    }
    SECTION("capsule, lying") {
        btCapsuleShapeX lying(0.3f, 0.8f);
        rests(lying, slab, below, {0, 0, 0.3f});
    }
    SECTION("cylinder, upright") {
        btCylinderShapeZ cylinder({0.3f, 0.3f, 0.4f});
        rests(cylinder, slab, below, {0, 0, 0.4f});
    }
    SECTION("cylinder, lying") {
        btCylinderShapeX cylinder({0.4f, 0.3f, 0.3f});
        rests(cylinder, slab, below, {0, 0, 0.3f});
    }
    SECTION("cone") {
        btConeShapeZ cone(0.4f, 0.6f);
        rests(cone, slab, below, {0, 0, 0.3f + cone.getMargin()});
    }
    SECTION("hull") {
        btConvexHullShape hull;
        for (int i = 0; i < 8; ++i) hull.addPoint({i & 1 ? .4f : -.4f, i & 2 ? .3f : -.3f, i & 4 ? .2f : -.2f});
        hull.setMargin(0.02f);
        rests(hull, slab, below, {0, 0, 0.22f});
    }
    SECTION("multisphere") {
        const btVector3 centres[] = {{-0.3f, -0.2f, 0}, {0.3f, -0.2f, 0}, {0, 0.3f, 0}};
        const float radii[] = {0.25f, 0.25f, 0.25f};
        btMultiSphereShape spheres(centres, radii, 3);
        rests(spheres, slab, below, {0, 0, 0.25f});
    }
    SECTION("compound of two boxes") {
        btBoxShape box({0.2f, 0.2f, 0.2f});
        btCompoundShape compound;
        compound.addChildShape(btTransform(btQuaternion::getIdentity(), {-0.3f, 0, 0}), &box);
        compound.addChildShape(btTransform(btQuaternion::getIdentity(), {0.3f, 0, 0}), &box);
        rests(compound, slab, below, {0, 0, 0.2f});
    }
}

TEST_CASE("A convex mesh rests on a field, and so does a body whose shape has changed") {
    Shape slab(exactBox({1, 1, 0.3f}, h));
    SECTION("a convex mesh of triangles") {
        TriangleShape cube(shapes::box({0.3f, 0.2f, 0.25f}));
        btConvexTriangleMeshShape convex(&cube.triangles);
        convex.setMargin(0);
        rests(convex, slab, {0, 0, 0}, {0, 0, 0.55f});
    }
    SECTION("another box, and a hull that has grown") {
        btBoxShape low({0.3f, 0.3f, 0.1f}), high({0.3f, 0.3f, 0.3f});
        btConvexHullShape hull;
        for (const float x : {-0.3f, 0.3f})
            for (const float y : {-0.3f, 0.3f})
                for (const float z : {-0.1f, 0.1f}) hull.addPoint({x, y, z});
        hull.setMargin(0);
        World world;
        world.add(slab, 0, {0, 0, 0});
        btRigidBody* box = world.add(low, 1, {0.5f, 0, 0.4f});
        btRigidBody* grows = world.add(hull, 1, {-0.5f, 0, 0.4f});
        world.run(0.5f);
        CHECK(box->getWorldTransform().getOrigin().z() == Approx(0.4f).margin(tolerance * h));
        CHECK(grows->getWorldTransform().getOrigin().z() == Approx(0.4f).margin(tolerance * h));
        box->setCollisionShape(&high);
        for (const float x : {-0.3f, 0.3f})
            for (const float y : {-0.3f, 0.3f}) hull.addPoint({x, y, -0.3f});
        for (btRigidBody* body : {box, grows}) {
            btTransform raised = body->getWorldTransform();
            raised.getOrigin() += btVector3(0, 0, 0.25f);
            body->setWorldTransform(raised);
            body->activate(true);
        }
        world.run(2);
        CHECK(box->getWorldTransform().getOrigin().z() == Approx(0.6f).margin(tolerance * h));
        CHECK(grows->getWorldTransform().getOrigin().z() == Approx(0.6f).margin(tolerance * h));
    }
}

TEST_CASE("Scaled fields rest where scaled bodies do") {
    const float scale = GENERATE(0.1f, 10.f);
    Shape body(exactTorus(0.5f, 0.2f, h)), slab(exactBox({1.5f, 1.5f, 0.3f}, h));
    body.setLocalScaling({scale, scale, scale});
    slab.setLocalScaling({scale, scale, scale});
    const btVector3 below(0, 0, -0.3f * scale);
    SECTION("field on field") {
        rests(body, slab, below, {0, 0, 0.2f * scale}, scale);
    }
    SECTION("box on field") {
        btBoxShape box(scale * btVector3(0.4f, 0.3f, 0.2f));
        rests(box, slab, below, {0, 0, 0.2f * scale}, scale);
    }
    SECTION("field on plane") {
        btStaticPlaneShape plane({0, 0, 1}, 0);
        rests(body, plane, {0, 0, 0}, {0, 0, 0.2f * scale}, scale);
    }
    SECTION("a body of another scale") {
        slab.setLocalScaling({2 * scale, 2 * scale, 2 * scale});
        rests(body, slab, 2 * below, {0, 0, 0.2f * scale}, scale);
    }
}

TEST_CASE("Bodies rest at the bottom of a field's bowl") {
    static const auto bowlCollider = exactBowl(1.5f, 0.2f, h);
    Shape bowl(bowlCollider);
    // the lowest place of the cavity is at -1.3
    SECTION("a field's sphere") {
        Shape sphere(exactSphere(0.4f, h));
        rests(sphere, bowl, {0, 0, 0}, {0, 0, -1.3f + 0.4f}, 1, true);
    }
    SECTION("a sphere") {
        btSphereShape sphere(0.4f);
        rests(sphere, bowl, {0, 0, 0}, {0, 0, -1.3f + 0.4f}, 1, true);
    }
    SECTION("a box, on its lower edges' corners") {
        btBoxShape box({0.5f, 0.5f, 0.2f});
        rests(box, bowl, {0, 0, 0}, {0, 0, -std::sqrt(1.3f * 1.3f - 0.5f) + 0.2f});
    }
    SECTION("a cylinder, on its rim") {
        btCylinderShapeZ cylinder({0.6f, 0.6f, 0.2f});
        rests(cylinder, bowl, {0, 0, 0}, {0, 0, -std::sqrt(1.3f * 1.3f - 0.36f) + 0.2f});
    }
    SECTION("a lying capsule, on its ends") {
        btCapsuleShapeX capsule(0.2f, 1.2f);
        rests(capsule, bowl, {0, 0, 0}, {0, 0, -std::sqrt(1.1f * 1.1f - 0.36f)}, 1, true);
    }
}

TEST_CASE("A bump of a field carries a flat face, and a groove both flanks of a sphere") {
    SECTION("a plate on three bumps") {
        // three spheres of one field under a plate: only the field's own points can contact its face
        Shape sphere(exactSphere(0.4f, h));
        btCompoundShape three;
        for (int i = 0; i < 3; ++i)
            three.addChildShape(
                btTransform(btQuaternion::getIdentity(), {0.8f * std::cos(2.1f * i), 0.8f * std::sin(2.1f * i), -0.4f}),
                &sphere);
        btBoxShape plate({1.5f, 1.5f, 0.1f});
        rests(plate, three, {0, 0, 0}, {0, 0, 0.1f});
    }
    SECTION("a sphere over the hole of a torus") {
        Shape torus(exactTorus(0.6f, 0.2f, h));
        btSphereShape sphere(0.6f);
        rests(sphere, torus, {0, 0, 0}, {0, 0, std::sqrt(0.8f * 0.8f - 0.36f)});
    }
}

TEST_CASE("A ghost object that dispatches its own pairs does not count as a step") {
    Shape floor(exactBox({1, 1, 0.1f}, h)), ball(exactSphere(0.2f, h));
    World world;
    btGhostPairCallback ghosts;
    world.broadphase.getOverlappingPairCache()->setInternalGhostPairCallback(&ghosts);
    world.add(floor, 0, {0, 0, -0.1f});
    for (int i = 0; i < 3; ++i) world.add(ball, 1, {-0.6f + 0.6f * i, 0.5f, 0.2f});
    btCapsuleShape capsule(0.1f, 0.3f);
    btPairCachingGhostObject ghost;
    ghost.setCollisionShape(&capsule);
    ghost.setWorldTransform(btTransform(btQuaternion::getIdentity(), {0, -0.5f, 0.09f}));
    world.dynamics.addCollisionObject(&ghost, btBroadphaseProxy::CharacterFilter, btBroadphaseProxy::AllFilter);
    world.run(0.1f);
    const bullet::DispatchStatistics before = world.dispatcher.statistics();
    CHECK(before.pairs >= 4);
    REQUIRE(ghost.getNumOverlappingObjects() == 1);
    btHashedOverlappingPairCache& own = *ghost.getOverlappingPairCache();
    world.dispatcher.dispatchAllCollisionPairs(&own, world.dynamics.getDispatchInfo(), &world.dispatcher);
    btManifoldArray manifolds;
    own.getOverlappingPairArray()[0].m_algorithm->getAllContactManifolds(manifolds);
    REQUIRE(manifolds.size() > 0);
    CHECK(manifolds[0]->getNumContacts() > 0);
    CHECK(world.dispatcher.statistics().pairs == before.pairs);
    CHECK(world.dispatcher.statistics().contactsKept == before.contactsKept);
    world.dynamics.removeCollisionObject(&ghost);
}
}  // namespace bilayer::pairs_test
