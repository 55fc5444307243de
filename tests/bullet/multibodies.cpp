// SPDX-License-Identifier: Apache-2.0
// Links of Bullet's multibodies as fields.
#include <BulletDynamics/Featherstone/btMultiBodyConstraintSolver.h>
#include <BulletDynamics/Featherstone/btMultiBodyDynamicsWorld.h>
#include <BulletDynamics/Featherstone/btMultiBodyLinkCollider.h>

#include <catch2/catch.hpp>
#include <memory>
#include <vector>

#include "integration/bullet/detail/velocity.h"
#include "tests/bullet/world.h"
#include "tests/support/random.h"
#include "tests/support/support.h"

namespace bilayer::multibodies_test {
using namespace bilayer::detail;
using namespace bilayer::bullet::detail;
using namespace bilayer::test;
using bullet::Shape;

namespace {

constexpr float h = 0.05f;  // voxel [m]

/// A floating base with a chain of links, and a collider for each of them.
struct Robot {
    btMultiBody body;
    std::vector<std::unique_ptr<btMultiBodyLinkCollider>> colliders;

    Robot(int links, btCollisionShape& shape) : body(links, 1, {0.01f, 0.01f, 0.01f}, false, false) {
        const btQuaternion still = btQuaternion::getIdentity();
        for (int i = 0; i < links; ++i) {
            const btVector3 ahead(0.3f, 0, 0), moment(0.01f, 0.01f, 0.01f);
            if (i % 3 == 0)
                body.setupRevolute(i, 1, moment, i - 1, still, {0, 0.6f, 0.8f}, ahead, ahead, true);
            else if (i % 3 == 1)
                body.setupPrismatic(i, 1, moment, i - 1, still, {0.8f, 0, 0.6f}, ahead, ahead, true);
            else
                body.setupSpherical(i, 1, moment, i - 1, still, ahead, ahead, true);
        }
        body.finalizeMultiDof();
        for (int i = -1; i < links; ++i) {
            colliders.push_back(std::make_unique<btMultiBodyLinkCollider>(&body, i));
            colliders.back()->setCollisionShape(&shape);
            if (i < 0)
                body.setBaseCollider(colliders.back().get());
            else
                body.getLink(i).m_collider = colliders.back().get();
        }
    }

    void update() {
        btAlignedObjectArray<btQuaternion> rotations;
        btAlignedObjectArray<btVector3> places;
        body.forwardKinematics(rotations, places);
        body.updateCollisionObjectWorldTransforms(rotations, places);
    }
};

}  // namespace

TEST_CASE("The velocities of links are those of their displacements per step") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    btSphereShape sphere(0.1f);
    Robot robot(5, sphere);
    const auto vector = [&] {
        const glm::vec3 v = random.point(2);
        return btVector3(v.x, v.y, v.z);
    };
    robot.body.setBaseVel(vector());
    robot.body.setBaseOmega(vector());
    for (int i = 0; i < robot.body.getNumLinks(); ++i)
        for (int d = 0; d < robot.body.getLink(i).m_dofCount; ++d) {
            std::vector<btScalar> speeds(robot.body.getJointVelMultiDof(i),
                                         robot.body.getJointVelMultiDof(i) + robot.body.getLink(i).m_dofCount);
            speeds[std::size_t(d)] = btScalar(random(-2, 2));
            robot.body.setJointVelMultiDof(i, speeds.data());
        }
    robot.body.stepPositionsMultiDof(0.2f);  // to another pose
    robot.update();
    std::vector<bullet::detail::Velocity> velocities;
    std::vector<btTransform> before;
    for (const auto& collider : robot.colliders) {
        velocities.push_back(bullet::detail::velocityOf(*collider));
        before.push_back(collider->getWorldTransform());
    }
    const float dt = 1e-3f;
    robot.body.stepPositionsMultiDof(dt);
    robot.update();
    for (std::size_t i = 0; i < before.size(); ++i) {
        CAPTURE(i);
        const btVector3 point = before[i] * btVector3(0.3f, 0.2f, -0.1f),
                        then = robot.colliders[i]->getWorldTransform() * btVector3(0.3f, 0.2f, -0.1f);
        CHECK((then - point).distance(dt * velocities[i].at(point)) < 0.02f * dt * (1 + velocities[i].linear.length()));
    }
}

TEST_CASE("A link does not pass through a thin plate if Bullet's bounding boxes overlap") {
    Shape ball(exactSphere(0.2f, h)), plate(exactBox({1, 1, h}, h));
    // Bullet does not extend the bounds of links by their displacement: they must overlap the plate's when the step
    // begins
    const float speed = GENERATE(1.f, 10.f, 15.f);
    CAPTURE(speed);
    btDefaultCollisionConfiguration configuration;
    bullet::Dispatcher dispatcher(&configuration);
    btDbvtBroadphase broadphase;
    btMultiBodyConstraintSolver solver;
    btMultiBodyDynamicsWorld world(&dispatcher, &broadphase, &solver, &configuration);
    world.setGravity({0, 0, 0});
    btRigidBody still(0, nullptr, &plate);
    world.addRigidBody(&still);
    Robot robot(0, ball);
    robot.body.setBasePos({0.05f, 0.03f, 1});
    robot.body.setBaseVel({0, 0, -speed});
    robot.body.setCanSleep(false);
    robot.update();
    world.addMultiBody(&robot.body);
    world.addCollisionObject(robot.colliders.front().get(), btBroadphaseProxy::DefaultFilter,
                             btBroadphaseProxy::AllFilter);
    for (int i = 0; i < 60; ++i) {
        world.stepSimulation(1 / 60.f, 0);
        REQUIRE(robot.body.getBasePos().z() > 0);
    }
    CHECK(robot.body.getBasePos().z() < 1);
    world.removeCollisionObject(robot.colliders.front().get());
    world.removeMultiBody(&robot.body);
    world.removeRigidBody(&still);
}
}  // namespace bilayer::multibodies_test
