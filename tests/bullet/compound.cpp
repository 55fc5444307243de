// SPDX-License-Identifier: Apache-2.0
// Fields as children of compounds.
#include <BulletCollision/CollisionDispatch/btCompoundCompoundCollisionAlgorithm.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "tests/bullet/world.h"

namespace bilayer::compound_test {
using namespace bilayer::test;
using bullet::Shape;

namespace {

constexpr float h = 0.05f;  // voxel [m]

btTransform at(const btVector3& place) {
    return btTransform(btQuaternion::getIdentity(), place);
}

}  // namespace

TEST_CASE("No child of a compound or of a nested compound passes through a plate at any speed") {
    const auto plate = exactBox({1.f, 1.f, h}, h), ball = exactSphere(0.2f, h);
    Shape plateShape(plate), ballShape(ball);
    btSphereShape sphere(0.2f);
    btStaticPlaneShape ground({0, 0, 1}, 0);
    btCompoundShape plates, inner, balls, spheres(false);
    plates.addChildShape(at({0, 0, -3}), &plateShape);
    plates.addChildShape(at({0, 0, 0}), &plateShape);
    inner.addChildShape(at({0, 0, 0.5f}), &ballShape);
    balls.addChildShape(at({0, 0, -0.5f}), &inner);
    spheres.addChildShape(at({0, 0, 0}), &sphere);
    const struct {
        const char* name;
        btCollisionShape &moving, &still;
    } cases[] = {{"a ball at a compound's plate", ballShape, plates},
                 {"a compound's ball at a plate", balls, plateShape},
                 {"a compound's ball at a compound's plate", balls, plates},
                 {"a compound's ball at the ground", balls, ground},
                 {"Bullet's own sphere at a compound's plate", sphere, plates},
                 {"Bullet's own sphere in a compound at a plate", spheres, plateShape}};
    for (const auto& one : cases)
        for (float speed = 1; speed <= 1000; speed *= 10) {
            CAPTURE(one.name, speed);
            World world;
            world.dynamics.setGravity({0, 0, 0});
            world.add(one.still, 0, {0, 0, 0});
            btRigidBody* body = world.add(one.moving, 1, {0.05f, 0.03f, 1.f});
            body->setLinearVelocity({0.1f * speed, 0, -speed});
            body->setActivationState(DISABLE_DEACTIVATION);
            for (float time = 0; time < 1.5f; time += 1 / 60.f) {
                world.dynamics.stepSimulation(1 / 60.f, 0);
                const btVector3 place = body->getCenterOfMassPosition();
                REQUIRE(std::isfinite(place.length2()));
                if (std::abs(place.x()) < 0.7f) REQUIRE(place.z() > 0);
            }
        }
}

TEST_CASE("A compound rests on its fields and on its other children, until a child is removed") {
    // two feet far from the middle, and a weight between them without contact
    Shape foot(exactBox({0.1f, 0.3f, 0.2f}, h)), slab(exactBox({2, 1, 0.3f}, h));
    btBoxShape own({0.1f, 0.3f, 0.2f}), weight({0.3f, 0.1f, 0.05f});
    btStaticPlaneShape plane({0, 0, 1}, 0);
    btBoxShape box({2, 1, 0.3f});
    const struct {
        const char* name;
        btCollisionShape& shape;
        float top;
    } grounds[] = {{"plane", plane, 0}, {"box", box, 0.3f}, {"field", slab, 0.3f}};
    for (const auto& ground : grounds) {
        CAPTURE(ground.name);
        btCompoundShape compound;
        compound.addChildShape(at({-0.5f, 0, 0}), &foot);
        compound.addChildShape(at({0.5f, 0, 0}), &own);
        compound.addChildShape(at({0, 0, 0.05f}), &weight);
        World world;
        world.add(ground.shape, 0, {0, 0, -ground.top});
        btRigidBody* body = world.add(compound, 2, {0, 0, 0.2f + 0.5f * h});
        world.run(2);
        // Bullet's own box may keep a margin above Bullet's own ground
        CHECK(body->getWorldTransform().getOrigin().z() == Approx(0.2f).margin(0.1 * h));
        CHECK(body->getWorldTransform().getBasis()[2][2] > std::cos(0.01f));

        compound.removeChildShape(&foot);
        body->activate(true);
        world.run(1);
        CHECK(body->getWorldTransform().getBasis()[2][2] < std::cos(0.1f));
        world.dynamics.removeRigidBody(body);
    }
}

TEST_CASE("Children that the user filters out do not collide") {
    Shape ball(exactSphere(0.2f, h)), slab(exactBox({1, 1, 0.3f}, h));
    btCompoundShape compound, ground;
    compound.addChildShape(at({0, 0, 0}), &ball);
    ground.addChildShape(at({0, 0, 0}), &slab);
    const bool both = GENERATE(false, true), ofCompounds = GENERATE(false, true);
    CAPTURE(both, ofCompounds);
    World world;
    world.add(both ? static_cast<btCollisionShape&>(ground) : slab, 0, {0, 0, -0.3f});
    btRigidBody* body = world.add(compound, 1, {0, 0, 0.25f});
    // Bullet calls another callback if both are compounds
    (ofCompounds ? gCompoundCompoundChildShapePairCallback : gCompoundChildShapePairCallback) =
        [](const btCollisionShape*, const btCollisionShape*) { return false; };
    world.run(0.5f);
    gCompoundChildShapePairCallback = gCompoundCompoundChildShapePairCallback = nullptr;
    CHECK((body->getCenterOfMassPosition().z() < -0.5f) == (both == ofCompounds));
}

TEST_CASE("Each child makes its contacts once, with a tree of boxes or without") {
    Shape box(exactBox({0.2f, 0.2f, 0.2f}, h)), slab(exactBox({1, 1, 0.3f}, h));
    btStaticPlaneShape plane({0, 0, 1}, 0);
    const bool hasTree = GENERATE(false, true), onField = GENERATE(false, true);
    CAPTURE(hasTree, onField);
    btCompoundShape compound(hasTree), ground(hasTree);
    compound.addChildShape(at({0, 0, 0}), &box);
    ground.addChildShape(at({0, 0, -0.3f}), &slab);
    World world;
    world.add(onField ? static_cast<btCollisionShape&>(ground) : plane, 0, {0, 0, 0});
    world.add(compound, 1, {0, 0, 0.2f});
    world.run(0.5f);
    CHECK(world.dispatcher.statistics().pairs == 1);
    CHECK(world.dispatcher.getNumManifolds() == 1);
}

namespace {

/// Values of a contact in a callback, and the callback's action.
struct Seen {
    std::vector<int> indices;  ///< of the child and of the compounds around it
    btDynamicsWorld* removesFrom = nullptr;
} seen;

bool look(btManifoldPoint&, const btCollisionObjectWrapper* first, int, int, const btCollisionObjectWrapper* second,
          int, int) {
    for (const btCollisionObjectWrapper* wrap : {first, second}) {
        if (wrap->getCollisionObject()->isStaticObject()) continue;
        seen.indices.clear();
        for (; wrap->m_parent; wrap = wrap->m_parent) {
            seen.indices.push_back(wrap->m_index);
            const auto* compound = static_cast<const btCompoundShape*>(wrap->m_parent->getCollisionShape());
            CHECK(compound->getChildShape(wrap->m_index) == wrap->getCollisionShape());
        }
        auto* body = const_cast<btRigidBody*>(btRigidBody::upcast(wrap->getCollisionObject()));
        if (seen.removesFrom) seen.removesFrom->removeRigidBody(body);
        seen.removesFrom = nullptr;
    }
    return true;
}

}  // namespace

TEST_CASE("Callbacks receive the child in contact, and may remove its body") {
    Shape ball(exactSphere(0.2f, h)), slab(exactBox({1, 1, 0.3f}, h));
    btSphereShape small(0.05f);
    btCompoundShape inner, outer;
    inner.addChildShape(at({0, 0, 0.3f}), &small);
    inner.addChildShape(at({0, 0, 0}), &ball);
    outer.addChildShape(at({0.3f, 0, 0.3f}), &small);
    outer.addChildShape(at({-0.3f, 0, 0.3f}), &small);
    outer.addChildShape(at({0, 0, 0}), &inner);
    World world;
    world.add(slab, 0, {0, 0, -0.3f});
    btRigidBody* body = world.add(outer, 1, {0, 0, 0.2f});
    body->setCollisionFlags(body->getCollisionFlags() | btCollisionObject::CF_CUSTOM_MATERIAL_CALLBACK);
    const bool removes = GENERATE(false, true);
    CAPTURE(removes);
    seen = {.indices = {}, .removesFrom = removes ? &world.dynamics : nullptr};
    gContactAddedCallback = look;
    world.run(0.1f);
    gContactAddedCallback = nullptr;
    CHECK(seen.indices == std::vector<int>{1, 2});
    CHECK(world.dynamics.getNumCollisionObjects() == (removes ? 1 : 2));
}

TEST_CASE("A compound's children are collided in one batch with all other pairs") {
    Shape ball(exactSphere(0.2f, h)), slab(exactBox({3, 3, 0.3f}, h));
    btCompoundShape compound;
    for (int i = 0; i < 100; ++i) compound.addChildShape(at({0.45f * (i % 10) - 2, 0.45f * (i / 10) - 2, 0}), &ball);
    World world;
    world.add(slab, 0, {0, 0, -0.3f});
    btRigidBody* body = world.add(compound, 10, {0, 0, 0.21f});
    world.run(1);
    CHECK(world.dispatcher.statistics().pairs == 100);
    CHECK(world.dispatcher.statistics().contactsKept >= 100);
    CHECK(body->getCenterOfMassPosition().z() == Approx(0.2f).margin(0.1 * h));
    // distant children cost nothing
    body->setCenterOfMassTransform(at({4.5f, 4.5f, 0.2f}));
    body->activate(true);
    world.run(1 / 240.f);
    CHECK(world.dispatcher.statistics().pairs < 60);
}
}  // namespace bilayer::compound_test
