// SPDX-License-Identifier: Apache-2.0
// Bodies that are stopped on their way through a step: where, and with which energy.
#include "integration/bullet/detail/body_sweep.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <memory>
#include <random>
#include <vector>

#include <bilayer/integration/bullet/extensions.h>
#include "demos/shared/shapes.h"
#include "integration/bullet/detail/convert.h"
#include "tests/bullet/world.h"
#include "tests/support/drops.h"
#include "tests/support/random.h"
#include "tests/support/support.h"

namespace bilayer::body_sweep_test {
using namespace bilayer::test;
using bullet::Shape;
using bullet::WorldExtensions;

namespace {

constexpr float h = 0.05f;        // voxel of the ball [m]
constexpr float step = 1 / 60.f;  // [s]

}  // namespace

TEST_CASE("A body is stopped on the path that it took, whatever changes its velocity after it has moved") {
    struct Kick : btActionInterface {
        btRigidBody* body = nullptr;
        btVector3 velocity{0, 0, 0};
        void updateAction(btCollisionWorld*, btScalar) override { body->setLinearVelocity(velocity); }
        void debugDraw(btIDebugDraw*) override {}
    };
    const unsigned seed = test::seed();
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> any(-1, 1);
    Shape ball(exactSphere(0.2f, h));
    const Mesh square{{{-1.2f, -1.2f, 0}, {1.2f, -1.2f, 0}, {1.2f, 1.2f, 0}, {-1.2f, 1.2f, 0}}, {{0, 1, 2}, {0, 2, 3}}};
    TriangleShape sheet(square);
    for (int shot = 0; shot < 40; ++shot) {
        World world;
        Kick kick;
        world.dynamics.addAction(&kick);
        const WorldExtensions guard(world.dynamics);
        world.dynamics.setGravity({0, 0, 0});
        world.add(*sheet.shape, 0, {0, 0, 0});
        kick.body = world.add(ball, 1, {0, 0, 1.f});
        kick.body->setLinearVelocity({100 * any(random), 100 * any(random), -500});
        if (shot % 2 == 1) {  // Bullet's own CCD stops it in the sheet
            kick.body->setCcdMotionThreshold(0.1f);
            kick.body->setCcdSweptSphereRadius(0.05f);
        }
        kick.velocity = 1000 * btVector3(any(random), any(random), any(random));
        world.dynamics.stepSimulation(step, 0);
        const btVector3 at = kick.body->getCenterOfMassPosition();
        CAPTURE(seed, shot, at.x(), at.y(), at.z());
        CHECK(guard.stoppedBodies() == 1);
        CHECK(std::abs(at.z() - 0.2f) < 0.1f * h);
        CHECK(std::max(std::abs(at.x()), std::abs(at.y())) < 0.2f);
        world.dynamics.removeAction(&kick);
    }
}

TEST_CASE("Flat bodies that tumble over waves of triangles gain no energy where they are stopped") {
    const unsigned seed = test::seed();
    Random random(seed);
    Shape plate(exactBox({0.3f, 0.3f, 0.03f}, 0.0125f)), box(exactBox({0.3f, 0.2f, 0.15f}, 0.0125f));
    const std::vector<Ground> all = grounds();
    int stopped = 0;
    for (int drop = 0; drop < 80; ++drop) {
        World world;
        const WorldExtensions guard(world.dynamics);
        world.add(*all[std::size_t(3 + drop % 2)].shape, 0, {0, 0, 0});
        Shape& shape = drop / 2 % 2 == 0 ? plate : box;
        const btQuaternion turned(bullet::detail::toBullet(random.direction()), float(random(0, 3)));
        btRigidBody* body = world.add(shape, 1, {float(random(-0.3, 0.3)), float(random(-0.3, 0.3)), 0.45f}, turned);
        body->setLinearVelocity(float(random(0, 6)) * bullet::detail::toBullet(random.direction()));
        body->setAngularVelocity(float(random(0, 30)) * bullet::detail::toBullet(random.direction()));
        body->setFlags(body->getFlags() & ~BT_ENABLE_GYROSCOPIC_FORCE_IMPLICIT_BODY);
        const double before = energyOf(*body, step);
        double least = before, gain = 0;
        for (int i = 0; i < 90; ++i) {
            world.dynamics.stepSimulation(step, 0);
            stopped += guard.stoppedBodies();
            const btVector3 at = body->getCenterOfMassPosition();
            if (std::max(std::abs(at.x()), std::abs(at.y())) > 1) break;
            least = std::min(least, energyOf(*body, step));
            gain = std::max(gain, energyOf(*body, step) - least);
        }
        CAPTURE(seed, drop, all[std::size_t(3 + drop % 2)].name, before, gain);
        CHECK(gain < 0.02 * before);
    }
    CHECK(stopped > 20);
}
}  // namespace bilayer::body_sweep_test
