// SPDX-License-Identifier: Apache-2.0
// Free bodies conserve their angular momentum; torques change it by the correct amount.
#include "integration/bullet/detail/gyroscopic_integrator.h"

#include <bilayer/integration/bullet/extensions.h>

#include <catch2/catch.hpp>
#include <stdexcept>

#include "demos/shared/world.h"
#include "tests/bullet/world.h"
#include "tests/support/random.h"
#include "tests/support/support.h"

namespace bilayer::gyroscopic_integrator_test {
using namespace bilayer::detail;
using namespace bilayer::bullet::detail;
using namespace bilayer::test;
using bullet::WorldExtensions;
using demo::kineticEnergyOf;

namespace {

constexpr bullet::ExtensionOptions gyroscopic{.continuousCollision = false, .gyroscopicIntegration = true};

btVector3 momentumOf(const btRigidBody& body) {
    const btMatrix3x3& axes = body.getWorldTransform().getBasis();
    return axes * (axes.transpose() * body.getAngularVelocity() / body.getInvInertiaDiagLocal());
}

// A brick in free space that spins about a principal axis or about two other axes.
struct Free {
    explicit Free(const btVector3& spin) {
        world.dynamics.setGravity({0, 0, 0});
        body = world.add(shape, 2, {0, 0, 0});
        body->setActivationState(DISABLE_DEACTIVATION);
        body->setAngularVelocity(spin);
    }
    btBoxShape shape{btVector3(0.3f, 0.2f, 0.1f)};
    World world;
    btRigidBody* body;
};

}  // namespace

TEST_CASE("Free bodies keep angular momentum and energy, however they spin") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (int trial = 0; trial < 10; ++trial) {
        const glm::vec3 spin = random.point(8);
        Free free({spin.x, spin.y, spin.z});
        const WorldExtensions keeps(free.world.dynamics, gyroscopic);
        const btVector3 before = momentumOf(*free.body);
        const double energy = kineticEnergyOf(*free.body);
        free.world.run(10);
        CAPTURE(spin.x, spin.y, spin.z);
        CHECK((momentumOf(*free.body) - before).length() < 1e-3f * before.length());
        CHECK(kineticEnergyOf(*free.body) == Approx(energy).epsilon(5e-3));
    }
}

TEST_CASE("Torques and impulses change the angular momentum by what they are") {
    Free free({1, 5, 2});
    const WorldExtensions keeps(free.world.dynamics, gyroscopic);
    const btVector3 before = momentumOf(*free.body), torque(0.3f, -0.2f, 0.5f), impulse(0.01f, 0.02f, -0.03f);
    free.body->applyTorqueImpulse(impulse);
    btVector3 expected = before + impulse;
    for (int i = 0; i < 120; ++i) {
        free.body->applyTorque(torque);
        free.world.run(1.f / 240);
        expected += torque / 240;
    }
    CHECK((momentumOf(*free.body) - expected).length() < 2e-2f * expected.length());
}

TEST_CASE("Extensions leave nothing behind in the world") {
    Free free({1, 5, 2});
    const int flags = free.body->getFlags();
    { const WorldExtensions keeps(free.world.dynamics, gyroscopic); }
    free.world.run(0.1f);
    CHECK(free.body->getFlags() == flags);
    GyroscopicIntegrator keeps(free.world.dynamics);
    keeps.beforeStep(0.01f);
    free.world.dynamics.removeRigidBody(free.body);
    CHECK_NOTHROW(keeps.afterStep());
    CHECK_NOTHROW(free.world.run(0.1f));
    free.world.dynamics.addRigidBody(free.body);
}

TEST_CASE("A world takes one gyroscopic integrator at a time") {
    Free free({1, 5, 2}), other({1, 5, 2});
    {
        const WorldExtensions keeps(free.world.dynamics, gyroscopic);
        CHECK_THROWS_AS(WorldExtensions(free.world.dynamics, gyroscopic), std::invalid_argument);
        CHECK_NOTHROW(WorldExtensions(free.world.dynamics));
        CHECK_NOTHROW(WorldExtensions(other.world.dynamics, gyroscopic));
        // the first one goes on
        const btVector3 before = momentumOf(*free.body);
        free.world.run(10);
        CHECK((momentumOf(*free.body) - before).length() < 1e-3f * before.length());
    }
    CHECK_NOTHROW(WorldExtensions(free.world.dynamics, gyroscopic));
    CHECK_NOTHROW(free.world.run(0.1f));
}

TEST_CASE("Tick callbacks of the user's are called with the extensions, set before or after them, and stay") {
    struct Ticks {
        int before = 0, after = 0;
    };
    const auto preTick = [](btDynamicsWorld* world, btScalar) {
        ++static_cast<Ticks*>(world->getWorldUserInfo())->before;
    };
    const auto tick = [](btDynamicsWorld* world, btScalar) { ++static_cast<Ticks*>(world->getWorldUserInfo())->after; };
    const bool isSetBefore = GENERATE(true, false);
    CAPTURE(isSetBefore);
    Free free({1, 5, 2});
    Ticks ticks;
    const auto set = [&] {
        free.world.dynamics.setInternalTickCallback(preTick, &ticks, true);
        free.world.dynamics.setInternalTickCallback(tick, &ticks);
    };
    if (isSetBefore) set();
    {
        const WorldExtensions keeps(free.world.dynamics, gyroscopic);
        if (!isSetBefore) set();
        const btVector3 before = momentumOf(*free.body);
        for (int i = 0; i < 240; ++i) free.world.dynamics.stepSimulation(1 / 240.f, 0);
        CHECK(ticks.before == 240);
        CHECK(ticks.after == 240);
        CHECK((momentumOf(*free.body) - before).length() < 1e-3f * before.length());
    }
    free.world.dynamics.stepSimulation(1 / 240.f, 0);
    CHECK(ticks.before == 241);
    CHECK(ticks.after == 241);
}
}  // namespace bilayer::gyroscopic_integrator_test
