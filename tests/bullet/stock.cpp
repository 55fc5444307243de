// SPDX-License-Identifier: Apache-2.0
// Fields with Bullet's own dispatcher.
#include <unistd.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cstdio>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "world.h"

using namespace bilayer;
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

/// Returns what `work` writes to standard error.
std::string errorsOf(const std::function<void()>& work) {
    std::fflush(stderr);
    std::FILE* file = std::tmpfile();
    REQUIRE(file);
    const int before = dup(STDERR_FILENO);
    dup2(fileno(file), STDERR_FILENO);
    work();
    std::fflush(stderr);
    dup2(before, STDERR_FILENO);
    close(before);
    std::rewind(file);
    std::string text(4096, ' ');
    text.resize(std::fread(text.data(), 1, text.size(), file));
    std::fclose(file);
    return text;
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

TEST_CASE("A dispatcher without fields gets one warning when the first two bodies fall through each other") {
    const auto slab = exactBox({1, 1, 0.3f}, h), ball = exactSphere(0.3f, h);
    const auto fall = [&](const std::function<void(StockWorld&)>& setUp, const btVector3& from) {
        return errorsOf([&] {
            Shape ground(slab), body(ball);
            StockWorld stock;
            setUp(stock);
            stock.add(ground, 0, {0, 0, 0});
            stock.add(body, 1, from);
            stock.run(60);
        });
    };
    const auto nothing = [](StockWorld&) {};
    // no warning for a field that meets only shapes that Bullet collides with its triangles, and that is drawn from a
    // copy of its transform
    CHECK(errorsOf([&] {
              Shape body(ball);
              btBoxShape box({1, 1, 0.3f});
              StockWorld stock;
              stock.add(box, 0, {0, 0, 0});
              const btRigidBody* falling = stock.add(body, 1, {0, 0, 1});
              for (int i = 0; i < 60; ++i) {
                  stock.run(1);
                  const btTransform copy = falling->getWorldTransform();
                  btVector3 lower, upper;
                  body.getAabb(copy, lower, upper);
              }
          }).empty());
    // nor for static fields that overlap
    CHECK(errorsOf([&] {
              Shape ground(slab), body(ball);
              StockWorld stock;
              stock.add(ground, 0, {0, 0, 0});
              stock.add(body, 0, {0, 0, 0.3f});
              stock.run(60);
          }).empty());
    // nor for static compounds of fields that overlap
    CHECK(errorsOf([&] {
              Shape body(ball);
              btCompoundShape compound;
              btBoxShape box({1, 1, 0.3f});
              for (int i = 0; i < 4; ++i)
                  compound.addChildShape(btTransform(btQuaternion::getIdentity(), {0.2f * float(i), 0, 0}), &body);
              StockWorld stock;
              stock.add(box, 0, {0, 0, 0});
              stock.add(compound, 1, {0, 0, 1});
              stock.run(60);
          }).empty());
    CHECK(fall(nothing, {0, 3, 1}).empty());  // passes by
    {
        btDefaultCollisionConfiguration configuration;
        const bullet::Dispatcher elsewhere(&configuration);
        CHECK(fall(nothing, {0, 0, 1}).empty());
    }
    std::unique_ptr<bullet::FieldAlgorithms> fields;
    CHECK(fall([&](StockWorld& stock) { fields = std::make_unique<bullet::FieldAlgorithms>(stock.dispatcher); },
               {0, 0, 1})
              .empty());
    fields.reset();
    const std::string warning = fall(nothing, {0, 0, 1});
    CAPTURE(warning);
    CHECK(warning.find("FieldAlgorithms") != std::string::npos);
    CHECK(std::count(warning.begin(), warning.end(), '\n') == 1);
    CHECK(fall(nothing, {0, 0, 1}).empty());
}
