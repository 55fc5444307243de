// SPDX-License-Identifier: Apache-2.0
// Resting bodies stay in place; rest stabilisation affects no other body.
#include <bilayer/integration/bullet/extensions.h>

#include <BulletDynamics/ConstraintSolver/btPoint2PointConstraint.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <optional>
#include <random>
#include <utility>
#include <vector>

#include "tests/bullet/world.h"
#include "tests/support/support.h"

namespace bilayer::rest_stabilisation_test {
using namespace bilayer::detail;
using namespace bilayer::bullet::detail;
using namespace bilayer::test;
using bullet::Shape;
using bullet::WorldExtensions;

namespace {

constexpr bullet::ExtensionOptions resting{.continuousCollision = false, .restStabilisation = true};

constexpr float h = 0.02f;  // voxel [m]

/// Friction along two tangents. With Bullet's single friction direction, bodies on slowly moving ones drift.
void useFriction(World& world) {
    world.dynamics.getSolverInfo().m_solverMode |= SOLVER_USE_2_FRICTION_DIRECTIONS;
    world.dynamics.getSolverInfo().m_numIterations = 40;
}

/// Rings that rest in a bowl, across each other.
struct Pile {
    Shape bowl{exactBowl(1, 0.1f, 2 * h)};
    Shape ring{exactTorus(0.2f, 0.07f, h), {.restingFriction = 1.5f}};
    World world;
    std::vector<btRigidBody*> rings;

    explicit Pile(unsigned seed) {
        useFriction(world);
        world.dynamics.getSolverInfo().m_frictionERP = 0.5f;
        world.add(bowl, 0, {0, 0, 0});
        std::mt19937 random(seed);
        std::uniform_real_distribution<float> any(-1, 1);
        for (int i = 0; i < 8; ++i) {
            const btQuaternion turn(any(random), any(random), any(random), any(random));
            rings.push_back(
                world.add(ring, 1, {0.2f * any(random), 0.2f * any(random), 0.6f * float(i)}, turn.normalized()));
            rings.back()->setActivationState(DISABLE_DEACTIVATION);
        }
    }

    /// Runs until no ring rocks, which takes some of them half a minute. Some rock so slowly that a second does not
    /// show it.
    void settle() {
        world.run(8);
        for (int i = 0; i < 15 && farthest(4) > 0.02f * h; ++i) {
        }
    }

    /// Maximum displacement of any ring, at any time in between.
    float farthest(float seconds) {
        std::vector<btVector3> before;
        for (const btRigidBody* body : rings) before.push_back(body->getCenterOfMassPosition());
        float most = 0;
        for (int part = 0; part < 10; ++part) {
            world.run(0.1f * seconds);
            for (std::size_t i = 0; i < rings.size(); ++i)
                most = std::max(most, before[i].distance(rings[i]->getCenterOfMassPosition()));
        }
        return most;
    }
};

/// A box on level frictionless ground with sleeping disabled, after one second.
struct BoxOnIce {
    Shape floor{exactBox({1, 1, 0.1f}, h)}, box{exactBox({0.1f, 0.1f, 0.1f}, h)};
    btRigidBody* body;

    explicit BoxOnIce(World& world) {
        world.add(floor, 0, {0, 0, -0.1f});
        body = world.add(box, 1, {0, 0, 0.1f});
        body->setFriction(0);
        body->setDamping(0, 0);
        body->setActivationState(DISABLE_DEACTIVATION);
        world.run(1);
    }
};

}  // namespace

TEST_CASE("A pile that cannot sleep does not drift, and falls when its bowl is removed") {
    const unsigned start = seed();
    CAPTURE(start);
    Pile pile(start);
    const WorldExtensions still(pile.world.dynamics, resting);
    pile.settle();
    CHECK(pile.farthest(4) < 0.02f * h);
    CHECK(still.restingBodies() + 2 >= int(pile.rings.size()));

    const float before = pile.rings.front()->getCenterOfMassPosition().z();
    for (int i = 0; i < pile.world.dynamics.getNumCollisionObjects(); ++i) {
        btCollisionObject* object = pile.world.dynamics.getCollisionObjectArray()[i];
        if (object->isStaticObject()) object->setWorldTransform(btTransform(btQuaternion(0, 0, 0, 1), {0, 0, -100}));
    }
    pile.world.dynamics.updateAabbs();
    pile.world.run(0.5f);
    CHECK(before - pile.rings.front()->getCenterOfMassPosition().z() == Approx(0.5f * 9.81f * 0.25f).epsilon(0.05));
    CHECK(still.restingBodies() == 0);
}

TEST_CASE("A body that wakes up is where it fell asleep") {
    const unsigned start = seed();
    const bool byIsland = GENERATE(false, true);  // Bullet then wakes the others, in the middle of a step
    CAPTURE(start, byIsland);
    Pile pile(start);
    const WorldExtensions still(pile.world.dynamics, resting);
    pile.settle();
    std::vector<btVector3> asleep;
    for (btRigidBody* ring : pile.rings) {
        ring->forceActivationState(ISLAND_SLEEPING);
        asleep.push_back(ring->getCenterOfMassPosition());
    }
    pile.world.run(0.5f);
    if (byIsland) {
        pile.rings[0]->forceActivationState(DISABLE_DEACTIVATION);
        pile.world.run(1 / 240.f);
        REQUIRE(std::count_if(pile.rings.begin(), pile.rings.end(), [](auto* ring) { return ring->isActive(); }) > 1);
    }
    for (btRigidBody* ring : pile.rings) ring->forceActivationState(DISABLE_DEACTIVATION);
    // bodies that Bullet woke have no weight for a step, and some of them get a speed that is gone some steps later
    pile.world.run(10 / 240.f);
    CHECK(still.restingBodies() + 2 >= int(pile.rings.size()));
    CHECK(pile.farthest(2) < 0.02f * h);
    for (std::size_t i = 0; i < pile.rings.size(); ++i)
        CHECK(asleep[i].distance(pile.rings[i]->getCenterOfMassPosition()) < 0.02f * h);
}

TEST_CASE("Rest stabilisation does not stop thrown, weightless, hanging or moved bodies") {
    Shape ball(exactSphere(0.1f, h));
    World world;
    const WorldExtensions still(world.dynamics, resting);

    SECTION("at the top of its path a body reverses as usual") {
        btRigidBody* body = world.add(ball, 1, {0, 0, 0});
        body->setLinearVelocity({0, 0, 2});
        world.run(1);
        CHECK(body->getCenterOfMassPosition().z() == Approx(2 - 0.5f * 9.81f).margin(0.03));
    }
    SECTION("without gravity, however slow") {
        world.dynamics.setGravity({0, 0, 0});
        btRigidBody* body = world.add(ball, 1, {0, 0, 0});
        body->setDamping(0, 0);
        body->setActivationState(DISABLE_DEACTIVATION);
        body->setLinearVelocity({1e-4f, 0, 0});
        world.run(10);
        CHECK(body->getCenterOfMassPosition().x() == Approx(1e-3f).epsilon(1e-3));
        CHECK(still.restingBodies() == 0);
    }
    SECTION("what hangs in a constraint") {
        btRigidBody* body = world.add(ball, 1, {0, 0, 0});
        btPoint2PointConstraint joint(*body, {0, 0, 0.5f});
        world.dynamics.addConstraint(&joint);
        body->setActivationState(DISABLE_DEACTIVATION);
        world.run(2);
        CHECK(still.restingBodies() == 0);
        world.dynamics.removeConstraint(&joint);
    }
    SECTION("what a force holds up") {
        btRigidBody* body = world.add(ball, 1, {0, 0, 0});
        body->setDamping(0, 0);
        body->setActivationState(DISABLE_DEACTIVATION);
        body->setLinearVelocity({3e-4f, 0, 0});
        for (int i = 0; i < 1200; ++i) {
            body->applyCentralForce({0, 0, 9.81f});
            world.run(1.f / 240);
        }
        CHECK(body->getCenterOfMassPosition().x() == Approx(1.5e-3f).epsilon(1e-3));
        CHECK(still.restingBodies() == 0);
    }
    SECTION("a slow turn about its middle") {
        useFriction(world);
        const BoxOnIce ice(world);
        btRigidBody* body = ice.body;
        body->setAngularVelocity({0, 0, 0.05f});
        const btVector3 before = body->getWorldTransform().getBasis().getColumn(0);
        world.run(2);
        CHECK(body->getWorldTransform().getBasis().getColumn(0).angle(before) == Approx(0.1f).epsilon(0.05));
    }
    SECTION("what lay still and is pushed once, on ice") {
        const BoxOnIce ice(world);
        btRigidBody* body = ice.body;
        REQUIRE(still.restingBodies() == 1);
        if (const bool slept = GENERATE(false, true); slept) {
            body->forceActivationState(ISLAND_SLEEPING);
            world.run(0.1f);
            body->forceActivationState(DISABLE_DEACTIVATION);
        }
        const float before = body->getCenterOfMassPosition().x(), speed = GENERATE(3e-3f, 7e-3f, 0.1f);
        CAPTURE(speed);
        body->setLinearVelocity({speed, 0, 0});
        world.run(2);
        CHECK(body->getCenterOfMassPosition().x() - before == Approx(2 * speed).epsilon(0.02));
    }
    SECTION("what the user puts elsewhere stays there, and so does what he turns, bit by bit too") {
        useFriction(world);
        Shape floor(exactBox({1, 1, 0.1f}, h)), box(exactBox({0.1f, 0.1f, 0.1f}, h));
        world.add(floor, 0, {0, 0, -0.1f});
        btRigidBody* body = world.add(box, 1, {0, 0, 0.1f});
        body->setActivationState(DISABLE_DEACTIVATION);
        world.run(3);
        REQUIRE(still.restingBodies() == 1);
        for (const float way : {0.4f, -0.15f, 0.45f * h, -0.25f * h, 0.15f * h, -0.35f * h}) {
            btTransform place = body->getWorldTransform();
            place.getOrigin() += btVector3(way, 0, 0);
            body->setWorldTransform(place);
            world.run(0.5f);
            CHECK(body->getCenterOfMassPosition().x() == Approx(place.getOrigin().x()).margin(2e-3 * h));
            CHECK(still.restingBodies() == 1);
        }
        world.dynamics.getSolverInfo().m_frictionERP = 0;  // else friction pulls it back
        const btTransform before = body->getWorldTransform();
        for (int i = 0; i < 240; ++i) {
            world.run(1.f / 240);
            btTransform place = body->getWorldTransform();
            place.setBasis(btMatrix3x3(btQuaternion({0, 0, 1}, 1e-4f)) * place.getBasis());
            body->setWorldTransform(place);
        }
        const btVector3 axis = body->getWorldTransform().getBasis().getColumn(0);
        CHECK(axis.angle(before.getBasis().getColumn(0)) > 0.01f);
    }
}

TEST_CASE("A pendulum gains no energy when it reverses, and comes to rest with damping") {
    // a tilt of 0.05 changes the speed near the turning point by as much per step as a push would
    const float perSecond = GENERATE(60.f, 240.f), damping = GENERATE(0.f, 0.2f), tilt = GENERATE(0.02f, 0.05f, 0.13f);
    CAPTURE(perSecond, damping, tilt);
    constexpr float radius = 0.3f, below = 0.12f;  // a ball whose mass lies below its middle
    btBoxShape floor({1, 1, 0.1f});
    btSphereShape sphere(radius);
    btCompoundShape tumbler;
    tumbler.addChildShape(btTransform(btQuaternion(0, 0, 0, 1), {0, 0, below}), &sphere);
    // end of the run; outputs are the speed in the last ten seconds, and the count of steps at the end in which the
    // body is held
    constexpr float until = 90;
    const auto swing = [&](bool holds) {
        World world;
        useFriction(world);
        std::optional<WorldExtensions> still;
        if (holds) still.emplace(world.dynamics, resting);
        world.add(floor, 0, {0, 0, -0.1f});
        btRigidBody* body = world.add(tumbler, 1, {-below * std::sin(tilt), 0, radius - below * std::cos(tilt)},
                                      btQuaternion({0, 1, 0}, tilt));
        body->setDamping(damping, damping);
        body->setActivationState(DISABLE_DEACTIVATION);
        std::vector<float> speeds;
        int held = 0;
        for (int i = 0; i < int(until * perSecond); ++i) {
            world.dynamics.stepSimulation(1 / perSecond, 1, 1 / perSecond);
            if (float(i) > (until - 10) * perSecond) speeds.push_back(body->getLinearVelocity().length());
            if (holds && float(i) >= (until - 1) * perSecond) held += still->restingBodies();
        }
        // uses typical speeds: single steps deviate with and without
        std::sort(speeds.begin(), speeds.end());
        return std::pair(speeds[speeds.size() * 9 / 10], held);
    };
    const auto [speed, held] = swing(true);
    if (damping == 0)
        CHECK(speed == Approx(swing(false).first).epsilon(0.01));
    else
        CHECK(held == int(perSecond));
}

TEST_CASE("A body on a slow kinematic platform moves with it, and a sensor carries nothing") {
    const bool isSensor = GENERATE(false, true);
    CAPTURE(isSensor);
    Shape platform(exactBox({1, 1, 0.1f}, h)), box(exactBox({0.1f, 0.1f, 0.1f}, h));
    World world;
    useFriction(world);
    const WorldExtensions still(world.dynamics, resting);
    if (isSensor) world.add(platform, 0, {0, 0, -0.1f});
    btRigidBody* moving = world.add(platform, 1, {0, 0, isSensor ? 0 : -0.1f});
    moving->setGravity({0, 0, 0});
    if (isSensor) moving->setCollisionFlags(moving->getCollisionFlags() | btCollisionObject::CF_NO_CONTACT_RESPONSE);
    btRigidBody* body = world.add(box, 1, {0, 0, 0.1f});
    for (btRigidBody* one : {moving, body}) one->setActivationState(DISABLE_DEACTIVATION);
    constexpr float speed = 5e-4f;
    const float before = body->getCenterOfMassPosition().x();
    for (int i = 0; i < 5 * 240; ++i) {
        moving->setLinearVelocity({speed, 0, 0});
        moving->setAngularVelocity({0, 0, 0});
        world.run(1 / 240.f);
    }
    const float gone = body->getCenterOfMassPosition().x() - before;
    if (isSensor)
        CHECK(std::abs(gone) < 1e-6f);
    else
        CHECK(gone == Approx(5 * speed).epsilon(0.02));
    CHECK(still.restingBodies() == (isSensor ? 1 : 0));
}

TEST_CASE("A stack on a slow lift or belt moves with it") {
    const btVector3 way =
        GENERATE(btVector3(0, 0, 1e-4f), btVector3(1e-4f, 0, 0), btVector3(5e-4f, 5e-4f, 0), btVector3(0, 0, -1e-4f));
    // friction-anchor ERP; the size of all bodies; and whether Bullet's own box is used
    const float pulledBack = GENERATE(0.f, 0.2f), size = GENERATE(0.1f, 1e-3f);
    const bool isField = GENERATE(true, false);
    CAPTURE(way.x(), way.z(), pulledBack, size, isField);
    const float voxel = 0.2f * size;
    Shape field(exactBox({size, size, size}, voxel)), fieldFloor(exactBox({10 * size, 10 * size, size}, voxel));
    btBoxShape box({size, size, size}), boxFloor({10 * size, 10 * size, size});
    box.setMargin(0.1f * voxel);
    World world;
    useFriction(world);
    world.dynamics.getSolverInfo().m_frictionERP = pulledBack;
    const WorldExtensions still(world.dynamics, resting);
    btRigidBody* lift = world.add(isField ? static_cast<btCollisionShape&>(fieldFloor) : boxFloor, 0, {0, 0, -size});
    lift->setCollisionFlags(lift->getCollisionFlags() | btCollisionObject::CF_KINEMATIC_OBJECT);
    lift->setActivationState(DISABLE_DEACTIVATION);
    std::vector<btRigidBody*> stack;
    for (int i = 0; i < 2; ++i) {
        stack.push_back(
            world.add(isField ? static_cast<btCollisionShape&>(field) : box, 1, {0, 0, float(2 * i + 1) * size}));
        stack.back()->setActivationState(DISABLE_DEACTIVATION);
    }
    world.run(2);
    std::vector<btVector3> before;
    for (const btRigidBody* body : stack) before.push_back(body->getCenterOfMassPosition());
    const btVector3 from = lift->getWorldTransform().getOrigin();
    constexpr int steps = 1200;
    for (int i = 1; i <= steps; ++i) {
        btTransform place = lift->getWorldTransform();
        place.setOrigin(from + float(i) / 240 * way);
        lift->setWorldTransform(place);
        world.run(1.f / 240);
    }
    const btVector3 expected = float(steps) / 240 * way;
    for (std::size_t i = 0; i < stack.size(); ++i)
        CHECK((stack[i]->getCenterOfMassPosition() - before[i]).distance(expected) < 0.1f * expected.length());
}
}  // namespace bilayer::rest_stabilisation_test
