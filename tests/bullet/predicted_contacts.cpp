// SPDX-License-Identifier: Apache-2.0
// Contacts of bodies that are about to touch.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "demos/shared/shapes.h"
#include "integration/bullet/detail/convert.h"
#include "tests/bullet/world.h"
#include "tests/support/random.h"
#include "tests/support/support.h"

namespace bilayer::predicted_contacts_test {
using namespace bilayer::detail;
using namespace bilayer::bullet::detail;
using namespace bilayer::test;
using bullet::Shape;

namespace {

constexpr float h = 0.05f;  // voxel [m]

}  // namespace

TEST_CASE("A body about to land has contacts at all corners, whether finer than the floor or not") {
    const bool fineFirst = GENERATE(false, true);
    CAPTURE(fineFirst);
    Shape floor(exactBox({1, 1, 0.2f}, 0.05f)), box(exactBox({0.03f, 0.03f, 0.03f}, 0.01f));
    World world;
    world.dynamics.setGravity({0, 0, 0});
    const auto addFloor = [&] { world.add(floor, 0, {0, 0, -0.2f}); };
    if (!fineFirst) addFloor();
    btRigidBody* body = world.add(box, 1, {0.3f, 0.2f, 0.03f + 0.08f});
    if (fineFirst) addFloor();
    body->setLinearVelocity({0, 0, -5});
    world.dynamics.stepSimulation(1 / 60.f, 0);
    const auto& pose = body->getWorldTransform();
    CHECK(pose.getOrigin().z() == Approx(0.03f).margin(0.005f));
    CHECK(body->getAngularVelocity().length() < 0.1f);
    REQUIRE(world.dispatcher.getNumManifolds() > 0);
    CHECK(world.dispatcher.statistics().contactsKept >= 4);
    int contacts = 0;
    for (int m = 0; m < world.dispatcher.getNumManifolds(); ++m)
        contacts += world.dispatcher.getManifoldByIndexInternal(m)->getNumContacts();
    CHECK(contacts == world.dispatcher.statistics().contactsKept);
}

TEST_CASE("Small bodies that fall by voxels per step are supported on all sides, and come to rest") {
    const unsigned seed = test::seed();
    const float size = GENERATE(0.01f, 0.03f), steps = GENERATE(60.f, 120.f);
    CAPTURE(seed, size, steps);
    Random random(seed);
    const float voxel = size / 32, minor = 0.15f * size;
    Shape ring(exactTorus(0.35f * size, minor, voxel));
    btStaticPlaneShape plane({0, 0, 1}, 0);
    for (int i = 0; i < 6; ++i) {
        const glm::vec3 axis = random.direction();
        World world;
        world.add(plane, 0, {0, 0, 0});
        btRigidBody* body = world.add(ring, 0.1f, {0, 0, 0.8f * size},
                                      btQuaternion(bullet::detail::toBullet(axis), float(random(0.05, 0.45))));
        for (float time = 0; time < 4; time += 1 / steps) world.dynamics.stepSimulation(1 / steps, 0);
        CHECK(body->getWorldTransform().getOrigin().z() > minor - 0.5f * voxel);
    }
}

TEST_CASE(
    "No body without CCD passes through a plate or gains energy: round ones at any speed, others at small rotations") {
    const float thickness = GENERATE(1.f, 2.f, 4.f);  // of the plate [voxels]
    CAPTURE(thickness);
    const auto plate = exactBox({1.f, 1.f, 0.5f * thickness * h}, h);
    const auto ball = exactSphere(0.2f, h), brick = exactBox({0.2f, 0.1f, 0.15f}, h);
    Shape plateShape(plate), ballShape(ball), brickShape(brick);
    btSphereShape sphere(0.2f);
    btCapsuleShape capsule(0.1f, 0.2f);
    btBoxShape box({0.2f, 0.1f, 0.15f}), plateBox({1.f, 1.f, 0.5f * thickness * h});
    btStaticPlaneShape ground({0, 0, 1}, 0);
    // an impact makes bodies with edges spin: in longer steps they would rotate by radians
    const float ofRound = 1 / 60.f, ofEdged = 1 / 240.f;  // [s]
    const struct {
        const char* name;
        btCollisionShape &moving, &still;
        float fastest, step;
    } cases[] = {{"a ball's field", ballShape, plateShape, 1000, ofRound},
                 {"a sphere", sphere, plateShape, 1000, ofRound},
                 {"a ball's field at a plane", ballShape, ground, 1000, ofRound},
                 {"a capsule", capsule, plateShape, 10, ofEdged},
                 {"a brick's field", brickShape, plateShape, 10, ofEdged},
                 {"a box", box, plateShape, 10, ofEdged},
                 {"a brick's field at a box", brickShape, plateBox, 10, ofEdged}};
    for (const auto& one : cases)
        for (float speed = 1; speed <= one.fastest; speed *= 10) {
            CAPTURE(one.name, speed);
            World world;
            world.dynamics.setGravity({0, 0, 0});
            world.add(one.still, 0, {0, 0, 0});
            btRigidBody* body =
                world.add(one.moving, 1, {0.05f, 0.03f, 1.f}, btQuaternion(btVector3(1, 2, 3).normalized(), 0.3f));
            body->setLinearVelocity({0.1f * speed, 0, -speed});
            body->setActivationState(DISABLE_DEACTIVATION);
            const float before = body->getLinearVelocity().length2();
            for (float time = 0; time < 2; time += one.step) {
                world.dynamics.stepSimulation(one.step, 0);
                const btVector3 v = body->getLinearVelocity(), w = body->getAngularVelocity();
                REQUIRE(std::isfinite(v.length2() + w.length2()));
                // the moments of inertia of all bodies here exceed 1e-3 m^2 times their mass
                REQUIRE(v.length2() + 1e-3f * w.length2() <= 1.01f * before);
                const btVector3 at = body->getCenterOfMassPosition();
                if (std::max(std::abs(at.x()), std::abs(at.y())) < 0.7f) REQUIRE(at.z() > 0);
            }
        }
}

TEST_CASE("Contact tests between steps use the current poses of fast bodies") {
    const auto ball = exactSphere(0.2f, h), plate = exactBox({1.f, 1.f, 0.1f}, h);
    Shape ballShape(ball), plateShape(plate);
    World world;
    btRigidBody* still = world.add(plateShape, 0, {0, 0, 0});
    btRigidBody* body = world.add(ballShape, 1, {0, 0, 3});
    body->setLinearVelocity({0, 0, -100});
    struct : btCollisionWorld::ContactResultCallback {
        int contacts = 0;
        btScalar addSingleResult(btManifoldPoint&, const btCollisionObjectWrapper*, int, int,
                                 const btCollisionObjectWrapper*, int, int) override {
            ++contacts;
            return 0;
        }
    } seen;
    world.dynamics.contactPairTest(body, still, seen);
    CHECK(seen.contacts == 0);
    for (int i = 0; i < 2; ++i) world.dynamics.stepSimulation(1 / 60.f, 0);
    CHECK(body->getCenterOfMassPosition().z() > 0.25f);
    CHECK(body->getCenterOfMassPosition().z() < 0.35f);
}
}  // namespace bilayer::predicted_contacts_test
