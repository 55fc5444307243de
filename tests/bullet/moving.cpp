// SPDX-License-Identifier: Apache-2.0
// Moving kinematic bodies, and soft bodies, against fields.
#include <BulletSoftBody/btSoftBodyHelpers.h>
#include <BulletSoftBody/btSoftBodyRigidBodyCollisionConfiguration.h>
#include <BulletSoftBody/btSoftRigidDynamicsWorld.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include <bilayer/integration/bullet/extensions.h>
#include <bilayer/sdf/build.h>
#include "demos/shared/shapes.h"
#include "integration/bullet/detail/convert.h"
#include "tests/bullet/world.h"

namespace bilayer::moving_test {
using namespace bilayer::detail;
using namespace bilayer::bullet::detail;
using namespace bilayer::test;
using bullet::Shape;
using bullet::detail::toBullet;

namespace {

constexpr float h = 0.05f;  // voxel [m]
constexpr float step = 1.f / 240;

void makeKinematic(btRigidBody& body) {
    body.setCollisionFlags(body.getCollisionFlags() | btCollisionObject::CF_KINEMATIC_OBJECT);
    body.setActivationState(DISABLE_DEACTIVATION);
}

// Moves a kinematic body at constant velocity, as its owner would between steps.
void carry(World& world, btRigidBody& body, const btVector3& velocity, float seconds) {
    for (int i = 0; i < std::lround(seconds / step); ++i) {
        btTransform at = body.getWorldTransform();
        at.setOrigin(at.getOrigin() + step * velocity);
        body.setWorldTransform(at);
        world.dynamics.stepSimulation(step, 1, step);
    }
}

}  // namespace

TEST_CASE("A kinematic field carries a body on it, up, down and along") {
    static const auto slabCollider = exactBox({1.5f, 1.5f, 0.3f}, h);
    Shape slab(slabCollider), ring(exactTorus(0.5f, 0.2f, h));
    btBoxShape box({0.4f, 0.3f, 0.2f});
    btCylinderShapeZ cylinder({0.3f, 0.3f, 0.2f});
    btCollisionShape* const shapes[] = {&ring, &box, &cylinder};
    const int kind = GENERATE(0, 1, 2);
    const btVector3 velocity = GENERATE(btVector3(0, 0, 0.5f), btVector3(0, 0, -0.5f), btVector3(0.4f, 0.2f, 0));
    CAPTURE(kind, velocity.x(), velocity.z());
    World world;
    btRigidBody* lift = world.add(slab, 0, {0, 0, -0.3f});
    makeKinematic(*lift);
    btRigidBody* body = world.add(*shapes[kind], 2, {0, 0, 0.2f});
    body->setFriction(1);
    lift->setFriction(1);
    carry(world, *lift, {0, 0, 0}, 0.5f);
    // accelerates slowly enough that the body need not slide or lift off
    for (int i = 1; i <= 20; ++i) carry(world, *lift, float(i) / 20 * velocity, 0.02f);
    const btVector3 before = body->getWorldTransform().getOrigin() - lift->getWorldTransform().getOrigin();
    carry(world, *lift, velocity, 1);
    const btVector3 after = body->getWorldTransform().getOrigin() - lift->getWorldTransform().getOrigin();
    CHECK(after.z() == Approx(0.5f).margin(0.1 * h));
    CHECK((after - before).length() < 0.1f * h);
    CHECK((body->getLinearVelocity() - velocity).length() < 1e-2f);
}

TEST_CASE("Kinematic bodies push fields, and fields push bodies") {
    static const auto cube = exactBox({0.3f, 0.3f, 0.3f}, h);
    const bool fieldPushes = GENERATE(false, true);
    CAPTURE(fieldPushes);
    Shape field(cube), other(cube);
    btBoxShape box({0.3f, 0.3f, 0.3f});
    btStaticPlaneShape ground({0, 0, 1}, 0);
    World world;
    world.add(ground, 0, {0, 0, 0})->setFriction(0.1f);
    btRigidBody* pusher = world.add(fieldPushes ? static_cast<btCollisionShape&>(field) : box, 0, {-1, 0, 0.35f});
    makeKinematic(*pusher);
    btRigidBody* pushed = world.add(fieldPushes ? static_cast<btCollisionShape&>(box) : other, 2, {0, 0, 0.3f});
    carry(world, *pusher, {0.8f, 0, 0}, 2);
    const float gap = pushed->getWorldTransform().getOrigin().x() - pusher->getWorldTransform().getOrigin().x() - 0.6f;
    CHECK(std::abs(gap) < 0.1f * h);
    CHECK(pushed->getWorldTransform().getOrigin().z() == Approx(0.3f).margin(0.1 * h));
    CHECK(pushed->getLinearVelocity().x() == Approx(0.8f).margin(0.02));
}

TEST_CASE("A kinematic bat drives an elastic ball away at twice its speed") {
    static const auto ballCollider = exactSphere(0.1f, h / 5);
    const float speed = GENERATE(1.f, 5.f, 20.f), start = GENERATE(range(0, 8)) / 8.f;
    CAPTURE(speed, start);
    btBoxShape plate({0.05f, 0.5f, 0.5f});
    Shape ball(ballCollider);
    World world;
    world.dynamics.setGravity({0, 0, 0});
    btRigidBody* bat = world.add(plate, 0, {-0.5f - start * step * speed, 0, 0});
    makeKinematic(*bat);
    btRigidBody* driven = world.add(ball, 1, {0, 0, 0});
    driven->setActivationState(DISABLE_DEACTIVATION);
    for (btRigidBody* body : {bat, driven}) body->setRestitution(1);
    carry(world, *bat, {speed, 0, 0}, 1 / speed);
    CHECK(driven->getLinearVelocity().x() == Approx(2 * speed).epsilon(0.01));
    CHECK(driven->getWorldTransform().getOrigin().x() > bat->getWorldTransform().getOrigin().x() + 0.15f);
}

namespace {

struct SoftWorld {
    SoftWorld() {
        dynamics.setGravity({0, 0, -9.81f});
        info().m_gravity = {0, 0, -9.81f};
        info().m_dispatcher = &dispatcher;
        info().m_broadphase = &broadphase;
        info().m_sparsesdf.Initialize();
    }
    ~SoftWorld() {
        if (soft) dynamics.removeSoftBody(soft.get());
        if (body) dynamics.removeRigidBody(body.get());
    }
    btSoftBodyWorldInfo& info() { return dynamics.getWorldInfo(); }
    void lay(btCollisionShape& shape, const btVector3& place, float mass = 0) {
        btRigidBody::btRigidBodyConstructionInfo its(mass, nullptr, &shape, btVector3(mass, mass, mass));
        its.m_startWorldTransform = btTransform(btQuaternion::getIdentity(), place);
        body = std::make_unique<btRigidBody>(its);
        dynamics.addRigidBody(body.get());
    }
    // Heights of the lowest and the highest node.
    std::pair<float, float> heights() const {
        float lowest = std::numeric_limits<float>::max(), highest = -lowest;
        for (int i = 0; i < soft->m_nodes.size(); ++i) {
            lowest = std::min(lowest, float(soft->m_nodes[i].m_x.z()));
            highest = std::max(highest, float(soft->m_nodes[i].m_x.z()));
        }
        return {lowest, highest};
    }
    float speed() const {
        float most = 0;
        for (int i = 0; i < soft->m_nodes.size(); ++i) most = std::max(most, float(soft->m_nodes[i].m_v.length()));
        return most;
    }

    btSoftBodyRigidBodyCollisionConfiguration configuration;
    bullet::Dispatcher dispatcher{&configuration};
    btDbvtBroadphase broadphase;
    btSequentialImpulseConstraintSolver solver;
    btSoftRigidDynamicsWorld dynamics{&dispatcher, &broadphase, &solver, &configuration};
    std::unique_ptr<btSoftBody> soft;
    std::unique_ptr<btRigidBody> body;
};

}  // namespace

TEST_CASE("Cloth and soft balls come to rest on a field as on its triangles") {
    const bool isCloth = GENERATE(true, false);
    const bool whole = GENERATE(true, false);  // on a slab, or over a smaller box
    CAPTURE(isCloth, whole);
    const Mesh mesh = shapes::box(whole ? glm::vec3(1.5f, 1.5f, 0.3f) : glm::vec3(0.3f, 0.3f, 0.3f), 6);
    const auto play = [&](btCollisionShape& shape) {
        SoftWorld world;
        world.lay(shape, {0, 0, -0.3f});
        if (isCloth) {
            world.soft.reset(btSoftBodyHelpers::CreatePatch(world.info(), {-0.5f, -0.5f, 0.3f}, {0.5f, -0.5f, 0.3f},
                                                            {-0.5f, 0.5f, 0.3f}, {0.5f, 0.5f, 0.3f}, 17, 17, 0, true));
        } else {
            world.soft.reset(btSoftBodyHelpers::CreateEllipsoid(world.info(), {0, 0, 0.5f}, {0.3f, 0.3f, 0.3f}, 200));
            world.soft->m_cfg.kPR = 20;
        }
        world.soft->m_cfg.kDP = 0.05f;
        world.soft->m_cfg.kDF = 1;
        world.soft->setTotalMass(0.5f);
        world.soft->getCollisionShape()->setMargin(0.02f);
        world.dynamics.addSoftBody(world.soft.get());
        for (int i = 0; i < 720; ++i) world.dynamics.stepSimulation(step, 1, step);
        return std::tuple_cat(world.heights(), std::tuple(world.speed()));
    };
    Shape field(std::make_shared<Collider>(mesh, build(mesh, {.voxelSize = h})));
    const TriangleShape reference(mesh);
    reference.shape->setMargin(field.getMargin());
    const auto [lowest, highest, speed] = play(field);
    const auto [itsLowest, itsHighest, itsSpeed] = play(*reference.shape);
    CAPTURE(lowest, highest, speed, itsLowest, itsHighest, itsSpeed);
    REQUIRE(std::isfinite(lowest + highest + speed));
    CHECK(lowest == Approx(itsLowest).margin(0.1 * h));
    CHECK(highest == Approx(itsHighest).margin(0.1 * h));
    CHECK(speed < std::max(2 * itsSpeed, 0.1f));
    if (whole) CHECK(lowest > -0.1f * h);
}

TEST_CASE("Continuous collision passes over soft bodies, which are no shapes of its surfaces") {
    Shape block(exactBox(glm::vec3(0.2f), h));
    SoftWorld world;
    const bullet::WorldExtensions extensions(world.dynamics);
    world.soft.reset(btSoftBodyHelpers::CreateEllipsoid(world.info(), {0, 0, 0}, {0.3f, 0.3f, 0.3f}, 50));
    world.dynamics.addSoftBody(world.soft.get());
    world.lay(block, {0, 0, 1}, 1);
    world.body->setLinearVelocity({0, 0, -400});
    for (int i = 0; i < 4; ++i) world.dynamics.stepSimulation(step, 1, step);
    CHECK(world.body->getWorldTransform().getOrigin().z() < 0);
}
}  // namespace bilayer::moving_test
