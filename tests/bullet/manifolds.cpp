// SPDX-License-Identifier: Apache-2.0
// What Bullet's manifolds hold: features, impulses, friction at rest, and what the user's callbacks see and change.
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <set>

#include "demos/shared/shapes.h"
#include "tests/bullet/world.h"
#include "tests/support/support.h"

namespace bilayer::manifolds_test {
using namespace bilayer::detail;
using namespace bilayer::bullet::detail;
using namespace bilayer::test;
using bullet::Shape;

namespace {

constexpr float h = 0.05f;  // voxel [m]

}  // namespace

TEST_CASE("Resting friction is higher by its factor, until the body slips") {
    World world;
    const bool more = GENERATE(false, true), inCompound = GENERATE(false, true);
    CAPTURE(more, inCompound);
    Shape floor(exactBox({4, 1, 0.1f}, 0.05f));
    Shape box(exactBox({0.2f, 0.2f, 0.1f}, 0.02f), {.restingFriction = more ? 1.2f : 1});
    btCompoundShape compound;
    compound.addChildShape(btTransform::getIdentity(), &box);
    world.add(floor, 0, {0, 0, -0.1f})->setFriction(1);
    btRigidBody* body = world.add(inCompound ? static_cast<btCollisionShape&>(compound) : box, 1, {0, 0, 0.1f});
    body->setFriction(0.5f);
    body->setActivationState(DISABLE_DEACTIVATION);
    // as on a slope: sliding distance in a given time
    const auto slides = [&](float slope, float seconds) {
        const float before = body->getWorldTransform().getOrigin().x();
        world.dynamics.setGravity({9.81f * slope, 0, -9.81f});
        world.run(seconds);
        return body->getWorldTransform().getOrigin().x() - before;
    };
    SECTION("it has rested") {
        CHECK(slides(0.45f, 1) < 1e-3f);
        CHECK((slides(0.57f, 0.5f) < 1e-3f) == more);
        CHECK(slides(0.65f, 0.2f) > 0.02f);
        CHECK(slides(0.55f, 0.2f) > 0.04f);
    }
    SECTION("it has not") {
        CHECK(slides(0.51f, 1) == Approx(0.5f * 9.81f * 0.01f).epsilon(0.1));
    }
    for (const float less : {0.9f, 0.f, std::numeric_limits<float>::quiet_NaN()})
        CHECK_THROWS_AS(Shape(exactBox({1, 1, 1}, 0.5f), {.restingFriction = less}), std::invalid_argument);
}

TEST_CASE("Callbacks receive contacts with their features, and impulses persist from step to step") {
    static int added, started;
    added = started = 0;
    Shape box(exactBox({0.3f, 0.3f, 0.2f}, h));
    btStaticPlaneShape plane({0, 0, 1}, 0);
    World world;
    world.add(plane, 0, {0, 0, 0});
    btRigidBody* body = world.add(box, 2, {0, 0, 0.2f});
    body->setCollisionFlags(body->getCollisionFlags() | btCollisionObject::CF_CUSTOM_MATERIAL_CALLBACK);
    gContactAddedCallback = [](btManifoldPoint&, const btCollisionObjectWrapper*, int, int index0,
                               const btCollisionObjectWrapper*, int, int index1) {
        added += index0 == -1 && index1 >= 0;
        return false;
    };
    gContactStartedCallback = [](btPersistentManifold* const&) { ++started; };
    world.run(0.5f);
    gContactAddedCallback = nullptr;
    gContactStartedCallback = nullptr;

    CHECK(added >= 4 * 100);
    CHECK(started <= 3);
    REQUIRE(world.dispatcher.getNumManifolds() == 1);
    const btPersistentManifold& manifold = *world.dispatcher.getManifoldByIndexInternal(0);
    REQUIRE(manifold.getNumContacts() == 4);
    float impulse = 0;
    for (int i = 0; i < 4; ++i) {
        impulse += manifold.getContactPoint(i).getAppliedImpulse();
        CHECK(manifold.getContactPoint(i).getLifeTime() > 50);
    }
    CHECK(impulse == Approx(2 * 9.81f / 240).epsilon(0.02));
}

TEST_CASE("User data of a contact persists with it, and is released at the end") {
    static int made, destroyed;
    made = destroyed = 0;
    Shape box(exactBox({0.3f, 0.3f, 0.2f}, h));
    btStaticPlaneShape plane({0, 0, 1}, 0);
    gContactAddedCallback = [](btManifoldPoint& point, const btCollisionObjectWrapper*, int, int,
                               const btCollisionObjectWrapper*, int, int) {
        made += !point.m_userPersistentData;
        if (!point.m_userPersistentData) point.m_userPersistentData = new int(made);
        point.m_combinedRestitution = 0.25f;
        return true;
    };
    gContactDestroyedCallback = [](void* data) {
        delete static_cast<int*>(data);
        ++destroyed;
        return true;
    };
    {
        World world;
        world.add(plane, 0, {0, 0, 0});
        btRigidBody* body = world.add(box, 2, {0, 0, 0.2f});
        body->setCollisionFlags(body->getCollisionFlags() | btCollisionObject::CF_CUSTOM_MATERIAL_CALLBACK);
        world.run(0.5f);
        REQUIRE(world.dispatcher.getNumManifolds() == 1);
        const btPersistentManifold& manifold = *world.dispatcher.getManifoldByIndexInternal(0);
        REQUIRE(manifold.getNumContacts() == 4);
        std::set<void*> kept;
        for (int i = 0; i < 4; ++i) {
            kept.insert(manifold.getContactPoint(i).m_userPersistentData);
            CHECK(manifold.getContactPoint(i).m_combinedRestitution == 0.25f);
        }
        CHECK(kept.size() == 4);
        CHECK(kept.count(nullptr) == 0);
        CHECK(made - destroyed == 4);
        CHECK(made < 20);
    }
    CHECK(made == destroyed);
    gContactAddedCallback = nullptr;
    gContactDestroyedCallback = nullptr;
}

TEST_CASE("A conveyor belt carries a body by the surface velocity that the user gives its contacts") {
    constexpr float speed = 0.1f;
    gContactAddedCallback = [](btManifoldPoint& point, const btCollisionObjectWrapper* first, int, int,
                               const btCollisionObjectWrapper*, int, int) {
        const bool beltIsFirst = first->getCollisionObject()->isStaticObject();
        point.m_lateralFrictionDir1 = {1, 0, 0};
        point.m_lateralFrictionDir2 = {0, 1, 0};
        point.m_contactPointFlags |= BT_CONTACT_FLAG_LATERAL_FRICTION_INITIALIZED;
        point.m_contactMotion1 = beltIsFirst ? -speed : speed;
        return true;
    };
    Shape belt(exactBox({1, 1, 0.1f}, h)), box(exactBox({0.1f, 0.1f, 0.1f}, h));
    World world;
    world.dynamics.getSolverInfo().m_solverMode |=
        SOLVER_ENABLE_FRICTION_DIRECTION_CACHING | SOLVER_USE_2_FRICTION_DIRECTIONS;
    btRigidBody* moving = world.add(belt, 0, {0, 0, -0.1f});
    moving->setCollisionFlags(moving->getCollisionFlags() | btCollisionObject::CF_CUSTOM_MATERIAL_CALLBACK);
    btRigidBody* body = world.add(box, 1, {-0.3f, 0, 0.1f});
    body->setActivationState(DISABLE_DEACTIVATION);
    world.run(4);
    gContactAddedCallback = nullptr;
    CHECK(body->getCenterOfMassPosition().x() + 0.3f == Approx(4 * speed).epsilon(0.01));
    CHECK(std::abs(body->getCenterOfMassPosition().y()) < 1e-3f);
}

TEST_CASE("The processed callback is called for persistent contacts") {
    static int processed;
    processed = 0;
    gContactProcessedCallback = [](btManifoldPoint&, void*, void*) {
        ++processed;
        return true;
    };
    Shape floor(exactBox({1, 1, 0.2f}, h)), box(exactBox({0.3f, 0.3f, 0.2f}, h));
    World world;
    world.add(floor, 0, {0, 0, -0.2f});
    world.add(box, 2, {0, 0, 0.2f})->setActivationState(DISABLE_DEACTIVATION);
    world.run(0.5f);
    gContactProcessedCallback = nullptr;
    CHECK(processed >= 4 * 110);
    CHECK(processed <= 12 * 120);
}

TEST_CASE("The started callback receives the contact as the solver does") {
    static float distance, apart;
    gContactStartedCallback = [](btPersistentManifold* const& manifold) {
        const btManifoldPoint& point = manifold->getContactPoint(0);
        distance = point.getDistance();
        apart = (point.getPositionWorldOnA() - point.getPositionWorldOnB()).dot(point.m_normalWorldOnB);
    };
    Shape floor(exactBox({1, 1, 0.2f}, h)), box(exactBox({0.3f, 0.3f, 0.2f}, h));
    World world;
    world.dynamics.setGravity({0, 0, 0});
    world.add(floor, 0, {0, 0, -0.2f});
    const float gap = GENERATE(0.5f, 3.f) * h;
    world.add(box, 2, {0, 0, 0.2f + gap})->setLinearVelocity({0, 0, -50});
    distance = apart = -1;
    world.dynamics.stepSimulation(1 / 240.f, 0);
    gContactStartedCallback = nullptr;
    CHECK(distance == Approx(gap).margin(0.01 * h));
    CHECK(apart == Approx(gap).margin(0.01 * h));
}

TEST_CASE("Global callbacks stay set while contacts are made on several threads") {
    static int asked, missing;
    asked = missing = 0;
    gContactAddedCallback = [](btManifoldPoint&, const btCollisionObjectWrapper*, int, int,
                               const btCollisionObjectWrapper*, int, int) { return false; };
    gContactStartedCallback = [](btPersistentManifold* const&) {};
    const CalculateCombinedCallback friction = gCalculateCombinedFrictionCallback;
    gCalculateCombinedFrictionCallback = [](const btCollisionObject*, const btCollisionObject*) {
        ++asked;
        missing += !gContactAddedCallback || !gContactStartedCallback;
        return btScalar(0.5f);
    };
    Shape floor(exactBox({1, 1, 0.2f}, h)), box(exactBox({0.3f, 0.3f, 0.2f}, h));
    World world;
    world.add(floor, 0, {0, 0, -0.2f});
    world.add(box, 2, {0, 0, 0.2f});
    world.run(0.1f);
    gCalculateCombinedFrictionCallback = friction;
    gContactAddedCallback = nullptr;
    gContactStartedCallback = nullptr;
    CHECK(asked > 0);
    CHECK(missing == 0);
}
}  // namespace bilayer::manifolds_test
