// SPDX-License-Identifier: Apache-2.0
// Fields with Bullet's own dispatcher.
#include <BulletCollision/CollisionShapes/btHeightfieldTerrainShape.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <functional>
#include <initializer_list>
#include <memory>
#include <string>
#include <vector>

#include "demos/shared/shapes.h"
#include "tests/bullet/world.h"

namespace bilayer::stock_test {
using namespace bilayer::test;
using bullet::Shape;

namespace {

constexpr float h = 0.05f;  // voxel [m]

/// A pile of fields and Bullet's shapes: positions of all bodies after one second, then the distance of two fields.
struct Played {
    std::vector<btTransform> places;
    float gap = 1;
};

Played play(btCollisionDispatcher& dispatcher, btCollisionConfiguration& configuration) {
    Shape slab(exactBox({1.5f, 1.5f, 0.3f}, h)), ring(exactTorus(0.4f, 0.15f, h)), ball(exactSphere(0.3f, h));
    btStaticPlaneShape ground({0, 0, 1}, -0.3f);
    btBoxShape box({0.2f, 0.3f, 0.1f});
    btCompoundShape compound;
    compound.addChildShape(btTransform(btQuaternion::getIdentity(), {0.1f, 0, 0}), &ball);
    const struct {
        btCollisionShape& shape;
        float mass;
        btVector3 at;
    } all[] = {{ground, 0, {0, 0, 0}},        {slab, 0, {0, 0, 0}},          {ring, 1, {0, 0, 0.5f}},
               {ring, 1, {0.1f, 0, 0.9f}},    {box, 1, {0.9f, 0.9f, 0.45f}}, {compound, 1, {-0.9f, 0.9f, 0.65f}},
               {ball, 1, {-0.9f, -1, 0.65f}}, {ball, 1, {-0.9f, -1, 1.35f}}};
    btDbvtBroadphase broadphase;
    btSequentialImpulseConstraintSolver solver;
    btDiscreteDynamicsWorld world(&dispatcher, &broadphase, &solver, &configuration);
    world.setGravity({0, 0, -9.81f});
    world.getDispatchInfo().m_deterministicOverlappingPairs = true;
    std::vector<std::unique_ptr<btRigidBody>> bodies;
    for (const auto& one : all) {
        btVector3 inertia(0, 0, 0);
        if (one.mass > 0) one.shape.calculateLocalInertia(one.mass, inertia);
        bodies.push_back(std::make_unique<btRigidBody>(one.mass, nullptr, &one.shape, inertia));
        bodies.back()->setWorldTransform(btTransform(btQuaternion::getIdentity(), one.at));
        world.addRigidBody(bodies.back().get());
    }
    for (int i = 0; i < 240; ++i) world.stepSimulation(1.f / 240, 1, 1.f / 240);
    Played played;
    for (const auto& body : bodies) played.places.push_back(body->getWorldTransform());

    struct Gap : btCollisionWorld::ContactResultCallback {
        float least = 1;
        btScalar addSingleResult(btManifoldPoint& point, const btCollisionObjectWrapper*, int, int,
                                 const btCollisionObjectWrapper*, int, int) override {
            least = std::min(least, float(point.getDistance()));
            return 0;
        }
    } gap;
    bodies[6]->setWorldTransform(btTransform(btQuaternion::getIdentity(), {0, 0, 2}));
    bodies[7]->setWorldTransform(btTransform(btQuaternion::getIdentity(), {0, 0, 2.62f}));
    world.contactPairTest(bodies[6].get(), bodies[7].get(), gap);
    played.gap = gap.least;
    for (const auto& body : bodies) world.removeRigidBody(body.get());
    return played;
}

}  // namespace

TEST_CASE("Fields collide on a dispatcher of Bullet's own as they do on theirs") {
    btDefaultCollisionConfiguration configuration;
    btCollisionDispatcher stock(&configuration);
    const bullet::FieldAlgorithms algorithms(stock);
    bullet::Dispatcher ours(&configuration);
    const Played played = play(stock, configuration), expected = play(ours, configuration);
    REQUIRE(played.places.size() == expected.places.size());
    for (std::size_t i = 0; i < played.places.size(); ++i) {
        CAPTURE(i, played.places[i].getOrigin().z(), expected.places[i].getOrigin().z());
        CHECK(played.places[i] == expected.places[i]);
        CHECK(played.places[i].getOrigin().z() > -0.01f);
    }
    CHECK(played.gap == Approx(0.02f).margin(0.1 * h));
    CHECK(played.gap == expected.gap);
}

TEST_CASE("Fast fields do not pass through a plate on a dispatcher of Bullet's own") {
    Shape plate(exactBox({1, 1, 0.05f}, h)), ball(exactSphere(0.3f, h));
    btDefaultCollisionConfiguration configuration;
    btCollisionDispatcher stock(&configuration);
    const bullet::FieldAlgorithms algorithms(stock);
    btDbvtBroadphase broadphase;
    btSequentialImpulseConstraintSolver solver;
    btDiscreteDynamicsWorld world(&stock, &broadphase, &solver, &configuration);
    btRigidBody still(0, nullptr, &plate), moving(1, nullptr, &ball, {0.1f, 0.1f, 0.1f});
    moving.setWorldTransform(btTransform(btQuaternion::getIdentity(), {0, 0, 2}));
    moving.setLinearVelocity({0, 0, -200});
    world.addRigidBody(&still);
    world.addRigidBody(&moving);
    for (int i = 0; i < 30; ++i) world.stepSimulation(1.f / 60, 1, 1.f / 60);
    CHECK(moving.getWorldTransform().getOrigin().z() > 0.2f);
    world.removeRigidBody(&still);
    world.removeRigidBody(&moving);
}

namespace {

std::vector<std::string> received;  // by a callback, which has no state of its own

/// Returns the warnings while `work` runs.
std::vector<std::string> warningsOf(const std::function<void()>& work) {
    received.clear();
    const auto before = bullet::setWarningCallback([](const char* message) { received.emplace_back(message); });
    work();
    bullet::setWarningCallback(before);
    return received;
}

/// A world of Bullet's own. Its dispatcher supports fields only if other code has registered them.
struct StockWorld {
    StockWorld() { world.setGravity({0, 0, -9.81f}); }
    ~StockWorld() {
        for (const auto& body : bodies) world.removeRigidBody(body.get());
    }
    btRigidBody* add(btCollisionShape& shape, float mass, const btVector3& place) {
        bodies.push_back(std::make_unique<btRigidBody>(mass, nullptr, &shape, btVector3(0.1f, 0.1f, 0.1f)));
        bodies.back()->setWorldTransform(btTransform(btQuaternion::getIdentity(), place));
        world.addRigidBody(bodies.back().get());
        return bodies.back().get();
    }
    void run(int steps) {
        for (int i = 0; i < steps; ++i) world.stepSimulation(1.f / 60, 1, 1.f / 60);
    }

    btDefaultCollisionConfiguration configuration;
    btCollisionDispatcher dispatcher{&configuration};
    btDbvtBroadphase broadphase;
    btSequentialImpulseConstraintSolver solver;
    btDiscreteDynamicsWorld world{&dispatcher, &broadphase, &solver, &configuration};
    std::vector<std::unique_ptr<btRigidBody>> bodies;
};

}  // namespace

TEST_CASE("A world whose dispatcher does not know fields gets one warning, whatever they meet") {
    Shape field(exactSphere(0.3f, h)), slab(exactBox({1, 1, 0.3f}, h));
    btBoxShape box({1, 1, 0.3f}), cube({0.3f, 0.3f, 0.3f});
    btStaticPlaneShape plane({0, 0, 1}, 0.3f);
    TriangleShape triangles(shapes::box({1, 1, 0.3f}));
    const std::vector<float> heights(9, 0.3f);
    btHeightfieldTerrainShape terrain(3, 3, heights.data(), 1, -1, 1, 2, PHY_FLOAT, false);
    btCompoundShape compound;
    for (int i = 0; i < 4; ++i)
        compound.addChildShape(btTransform(btQuaternion::getIdentity(), {0.2f * float(i), 0, 0}), &field);
    const auto fall = [](btCollisionShape& ground, btCollisionShape& body, float mass = 1,
                         const std::function<void(StockWorld&)>& setUp = {}) {
        return warningsOf([&] {
            StockWorld stock;
            if (setUp) setUp(stock);
            stock.add(ground, 0, {0, 0, 0});
            stock.add(body, mass, {0, 0, 1});
            stock.run(60);
        });
    };
    for (btCollisionShape* ground :
         std::initializer_list<btCollisionShape*>{&slab, &box, &plane, triangles.shape.get(), &terrain}) {
        CAPTURE(ground->getName());
        const auto warnings = fall(*ground, field);
        REQUIRE(warnings.size() == 1);
        CHECK(warnings.front().find("FieldAlgorithms") != std::string::npos);
    }
    CHECK(fall(slab, cube).size() == 1);
    CHECK(fall(box, compound).size() == 1);

    // static fields, and dispatchers that know fields
    CHECK(fall(slab, field, 0).empty());
    CHECK(fall(box, cube).empty());
    {
        btDefaultCollisionConfiguration configuration;
        const bullet::Dispatcher elsewhere(&configuration);
        CHECK(fall(slab, field).empty());
    }
    std::unique_ptr<bullet::FieldAlgorithms> fields;
    const auto know = [&](StockWorld& stock) { fields = std::make_unique<bullet::FieldAlgorithms>(stock.dispatcher); };
    CHECK(fall(slab, field, 1, know).empty());
}
}  // namespace bilayer::stock_test
