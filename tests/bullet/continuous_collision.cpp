// SPDX-License-Identifier: Apache-2.0
// Tunnelling prevention at any speed: it acts after the solver, along the actual trajectories of bodies.
#include <bilayer/integration/bullet/extensions.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <memory>
#include <random>

#include <bilayer/sdf/build.h>
#include "demos/shared/shapes.h"
#include "integration/bullet/detail/convert.h"
#include "tests/bullet/world.h"
#include "tests/support/random.h"
#include "tests/support/support.h"

namespace bilayer::continuous_collision_test {
using namespace bilayer::detail;
using namespace bilayer::bullet::detail;
using namespace bilayer::test;
using bullet::Shape;
using bullet::WorldExtensions;

namespace {

constexpr float h = 0.05f;        // voxel [m]
constexpr float step = 1 / 60.f;  // [s]

/// Kinetic energy of a body. Under rotation Bullet keeps the angular velocity of a body, not its energy.
/// @param atLeast  after an impact: the minimum energy for this angular velocity
double energyOf(const btRigidBody& body, bool atLeast) {
    const btVector3 spin = body.getWorldTransform().getBasis().transpose() * body.getAngularVelocity();
    const btVector3& inverse = body.getInvInertiaDiagLocal();
    const double most = std::max({inverse.x(), inverse.y(), inverse.z()});
    double energy = 0.5 * double(body.getLinearVelocity().length2()) / body.getInvMass();
    for (int k = 0; k < 3; ++k) energy += 0.5 * double(spin[k]) * spin[k] / (atLeast ? most : double(inverse[k]));
    return energy;
}

/// A plate of two triangles.
struct SquarePlate {
    btTriangleMesh triangles;
    std::unique_ptr<btBvhTriangleMeshShape> shape;

    explicit SquarePlate(float half) {
        const btVector3 a(-half, -half, 0), b(half, -half, 0), c(half, half, 0), d(-half, half, 0);
        triangles.addTriangle(a, b, c);
        triangles.addTriangle(a, c, d);
        shape = std::make_unique<btBvhTriangleMeshShape>(&triangles, true);
    }
};

}  // namespace

TEST_CASE("No body passes through a thin plate or gains energy, at any speed and rotation") {
    const float thickness = GENERATE(1.f, 2.f, 4.f);  // of the plate [voxels]
    const unsigned seed = test::seed();
    CAPTURE(thickness, seed);
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> any(-1, 1);
    const float half = 1.2f;
    Shape plate(exactBox({half, half, 0.5f * thickness * h}, h)), ball(exactSphere(0.2f, h)),
        brick(exactBox({0.2f, 0.1f, 0.15f}, h)), ring(exactTorus(0.25f, 0.08f, h));
    btSphereShape sphere(0.2f);
    btCapsuleShape capsule(0.1f, 0.2f);
    btCylinderShape cylinder({0.15f, 0.1f, 0.15f});
    btBoxShape box({0.2f, 0.1f, 0.15f}), plateBox({half, half, 0.5f * thickness * h});
    btStaticPlaneShape ground({0, 0, 1}, 0);
    SquarePlate quad(half);
    const struct {
        const char* name;
        btCollisionShape &moving, &still;
    } cases[] = {
        {"ball, plate", ball, plate},     {"brick, plate", brick, plate},     {"ring, plate", ring, plate},
        {"sphere, plate", sphere, plate}, {"capsule, plate", capsule, plate}, {"cylinder, plate", cylinder, plate},
        {"box, plate", box, plate},       {"ball, plane", ball, ground},      {"brick, plane", brick, ground},
        {"brick, box", brick, plateBox},  {"ball, quad", ball, *quad.shape},  {"brick, quad", brick, *quad.shape},
        {"ring, box", ring, plateBox}};
    for (const auto& one : cases)
        for (float speed = 1; speed <= 1000; speed *= 10)
            for (int shot = 0; shot < 3; ++shot) {
                World world;
                const WorldExtensions guard(world.dynamics);
                world.dynamics.setGravity({0, 0, 0});
                world.add(one.still, 0, {0, 0, 0});
                const btQuaternion turned(btVector3(any(random), any(random), any(random) + 2).normalized(),
                                          3 * any(random));
                btRigidBody* body = world.add(one.moving, 1, {0.1f * any(random), 0.1f * any(random), 1.f}, turned);
                // oblique by up to about 30 degrees, but still aimed at the plate
                const float sideways = std::min(0.5f, 0.5f * half);
                body->setLinearVelocity(speed * btVector3(sideways * any(random), sideways * any(random), -1));
                body->setAngularVelocity(0.3f * speed * btVector3(any(random), any(random), any(random)));
                body->setActivationState(DISABLE_DEACTIVATION);
                // Bullet's own gyroscopic integrator adds energy without bound to a body that rotates by radians in a
                // step
                body->setFlags(body->getFlags() & ~BT_ENABLE_GYROSCOPIC_FORCE_IMPLICIT_BODY);
                const double before = energyOf(*body, false);
                CAPTURE(one.name, speed, shot);
                for (int i = 0; i < 2.5f / (speed * step) + 20; ++i) {
                    world.dynamics.stepSimulation(step, 0);
                    const btVector3 at = body->getCenterOfMassPosition();
                    CAPTURE(i, at.x(), at.y(), at.z());
                    REQUIRE(std::isfinite(energyOf(*body, true)));
                    REQUIRE(energyOf(*body, true) <= 1.01 * before);
                    // beyond the plate's rim it may fall
                    if (std::max(std::abs(at.x()), std::abs(at.y())) > half - 0.3f) break;
                    REQUIRE(at.z() > 0);
                }
            }
}

TEST_CASE("A body stopped by a wall is not overrun by the next body") {
    const float radius = 0.2f;
    // points are followed from 0.25 voxels inside their body to 0.1 below the surface where they enter; and round
    // bodies penetrate further between points (see ColliderOptions::pointSpacingVoxels)
    const float deepest = 0.35f * h + 0.23f * 4 * h * h / radius;
    Shape ball(exactSphere(radius, h)), wall(exactBox({h, 1, 1}, h));
    const unsigned seed = test::seed();
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> any(0, 1);
    int held = 0;
    for (int draw = 0; draw < 40; ++draw) {
        World world;
        const WorldExtensions guard(world.dynamics);
        world.dynamics.setGravity({0, 0, 0});
        // without solver iterations only tunnelling prevention stops them
        world.dynamics.getSolverInfo().m_numIterations = 0;
        world.add(wall, 0, {2, 0, 0});
        const auto add = [&](const btVector3& place, float speed) {
            btRigidBody* body = world.add(ball, 1, place);
            body->setLinearVelocity({speed, 0, 0});
            return body;
        };
        const float aside = 0.1f * any(random), apart = 2 * radius + 0.5f * h * any(random);
        const btRigidBody *first = add({1.3f, 0, 0}, 40 + 20 * any(random)),
                          *second = add({1.3f - std::sqrt(apart * apart - aside * aside), aside, 0}, 58);
        for (int i = 0; i < 6; ++i) {
            world.dynamics.stepSimulation(step, 0);
            held += guard.stoppedBodies();
            CAPTURE(seed, draw, i);
            CHECK(first->getCenterOfMassPosition().distance(second->getCenterOfMassPosition()) > 2 * radius - deepest);
        }
    }
    CHECK(held > 40);
}

TEST_CASE("A body stopped by a wall is not overrun by a long column of bodies") {
    const float radius = 0.2f;
    // as above; both bodies are round and penetrate between points
    const float deepest = 0.35f * h + 2 * 0.23f * 4 * h * h / radius;
    Shape ball(exactSphere(radius, h)), wall(exactBox({h, 1, 1}, h));
    World world;
    const WorldExtensions guard(world.dynamics);
    world.dynamics.setGravity({0, 0, 0});
    world.add(wall, 0, {2, 0, 0});
    const unsigned seed = test::seed();
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> any(0, 1);
    std::vector<btRigidBody*> column;
    for (float x = 1.7f; column.size() < 50; x -= 2 * radius + 0.5f * h * any(random)) {
        column.push_back(world.add(ball, 1, {x, 0, 0}));
        column.back()->setLinearVelocity({58, 0, 0});
    }
    int held = 0;
    for (int i = 0; i < 2; ++i) {
        world.dynamics.stepSimulation(step, 0);
        held += guard.stoppedBodies();
        // some are pushed sideways
        for (std::size_t k = 0; k < column.size(); ++k)
            for (std::size_t other = 0; other < k; ++other) {
                CAPTURE(seed, i, k, other);
                CHECK(column[other]->getCenterOfMassPosition().distance(column[k]->getCenterOfMassPosition()) >
                      2 * radius - deepest);
            }
    }
    CHECK(held > 40);
}

TEST_CASE("Small and thin bodies do not penetrate, even if an impact rotates them by half their size in a step") {
    const float size = GENERATE(0.01f, 0.03f), voxel = size / 32;
    const unsigned seed = test::seed();
    CAPTURE(size, seed);
    Random random(seed);
    const struct {
        const char* name;
        Mesh mesh;
    } kinds[] = {{"ring", shapes::torus(0.35f * size, 0.15f * size)},
                 {"disc", shapes::cylinder(0.5f * size, 0.1f * size)},
                 {"rod", shapes::cylinder(0.07f * size, size)},
                 {"plate", shapes::box({0.5f * size, 0.4f * size, 0.06f * size})},
                 {"cone", shapes::cone(0.4f * size, size)}};
    btStaticPlaneShape plane({0, 0, 1}, 0);
    btBoxShape box({5 * size, 5 * size, size});
    Shape slab(exactBox({2 * size, 2 * size, size}, voxel));
    const struct {
        const char* name;
        btCollisionShape& shape;
        float top;
    } grounds[] = {{"plane", plane, 0}, {"box", box, size}, {"field", slab, size}};
    for (const auto& kind : kinds) {
        Shape shape(std::make_shared<Collider>(kind.mesh, build(kind.mesh, {.voxelSize = voxel})));
        for (const auto& ground : grounds)
            for (int i = 0; i < 6; ++i) {
                CAPTURE(kind.name, ground.name, i);
                World world;
                const WorldExtensions guard(world.dynamics);
                world.add(ground.shape, 0, {0, 0, -ground.top});
                const btVector3 axis = bullet::detail::toBullet(random.direction());
                btRigidBody* body = world.add(shape, 0.1f, {0, 0, size}, btQuaternion(axis, float(random(0, 3))));
                for (int k = 0; k < 120; ++k) world.dynamics.stepSimulation(step, 0);
                CHECK(lowest(kind.mesh, body->getWorldTransform()) > -0.6f * voxel);
            }
    }
}

TEST_CASE("Two fast bodies do not pass each other, nor what they meet after a bounce") {
    Shape ball(exactSphere(0.2f, h)), wall(exactBox({1.f, 1.f, 0.5f * h}, h));
    World world;
    const WorldExtensions guard(world.dynamics);
    world.dynamics.setGravity({0, 0, 0});
    btRigidBody *left = world.add(ball, 1, {-5, 0, 0}), *right = world.add(ball, 1, {5.5f, 0, 0});
    left->setLinearVelocity({800, 0, 0});
    right->setLinearVelocity({-900, 0, 0});
    int held = 0;
    for (int i = 0; i < 10; ++i) {
        world.dynamics.stepSimulation(step, 0);
        held += guard.stoppedBodies();
        CHECK(right->getCenterOfMassPosition().x() - left->getCenterOfMassPosition().x() > 0.4f - 0.5f * h);
    }
    CHECK(held >= 2);

    // a ball that bounces off one plate in a step must not tunnel through the other
    World between;
    const WorldExtensions other(between.dynamics);
    between.dynamics.setGravity({0, 0, 0});
    between.add(wall, 0, {0, 0, 0})->setRestitution(1);
    between.add(wall, 0, {0, 0, 2})->setRestitution(1);
    btRigidBody* body = between.add(ball, 1, {0, 0, 1.1f});
    body->setRestitution(0.9f);
    body->setLinearVelocity({0, 0, -500});
    for (int i = 0; i < 30; ++i) {
        between.dynamics.stepSimulation(step, 0);
        const btVector3 at = body->getCenterOfMassPosition();
        CAPTURE(i, at.x(), at.y(), at.z());
        if (std::max(std::abs(at.x()), std::abs(at.y())) > 0.7f) break;
        CHECK(at.z() > 0);
        CHECK(at.z() < 2);
    }
}

TEST_CASE("Edges and vertices of static bodies stop fields as well, however thin they are") {
    const float speed = GENERATE(14.f, 30.f, 60.f);
    const int kind = GENERATE(0, 1, 2);
    const unsigned seed = test::seed();
    CAPTURE(speed, kind, seed);
    Random random(seed);
    const float half = 0.1f, voxel = 0.2f / 32, apart = 0.083f;
    // upright open surfaces with their upper edges at height 0, a needle of triangles, or a long blade
    Mesh sheets;
    for (int i = -20; i <= 20; ++i) {
        const auto first = unsigned(sheets.points.size());
        const float y = apart * float(i);
        for (const glm::vec3& p : {glm::vec3(-2, y, -0.5f), {2, y, -0.5f}, {2, y, 0}, {-2, y, 0}})
            sheets.points.push_back(p);
        sheets.triangles.push_back(first + glm::uvec3(0, 1, 2));
        sheets.triangles.push_back(first + glm::uvec3(0, 2, 3));
    }
    Mesh needle = shapes::cone(0.006f, 0.5f, 12);
    for (glm::vec3& point : needle.points) point.z -= 0.25f;
    TriangleShape triangles(kind == 0 ? sheets : needle);
    btBoxShape blade({3, 3e-4f, 0.25f});
    Shape cube(exactBox({half, half, half}, voxel));
    for (int i = 0; i < 12; ++i) {
        World world;
        const WorldExtensions guard(world.dynamics);
        // the fewer iterations, the more speed the solver leaves
        world.dynamics.getSolverInfo().m_numIterations = i < 4 ? 10 : 4;
        if (kind == 2)
            world.add(blade, 0, {0, 0, -0.25f});
        else
            world.add(*triangles.shape, 0, {0, 0, 0});
        btRigidBody* body = world.add(cube, 1, {float(random(-0.05, 0.05)), float(random(-0.05, 0.05)), 0.5f},
                                      btQuaternion({1, 0, 0}, float(random(-0.05, 0.05))));
        body->setLinearVelocity({0, 0, -speed});
        float deepest = 0;
        for (int n = 0; n < (i < 4 ? 30 : 10); ++n) {
            world.dynamics.stepSimulation(step, 0);
            const btTransform into = body->getWorldTransform().inverse();
            const auto look = [&](float x, float y) {
                const btVector3 place = (into * btVector3(x, y, 0)).absolute();
                deepest = std::min(deepest, std::max({place.x(), place.y(), place.z()}) - half);
            };
            const float middle = kind == 1 ? 0 : body->getWorldTransform().getOrigin().x();
            if (kind == 1) look(0, 0);
            for (float x = -0.2f; kind != 1 && x <= 0.2f; x += 0.01f)
                for (int k = kind == 0 ? -20 : 0; k <= (kind == 0 ? 20 : 0); ++k)
                    look(std::clamp(middle + x, -2.f, 2.f), apart * float(k));
        }
        CHECK(deepest > -0.5f * voxel);
    }
}

TEST_CASE("A body that hits hard does not penetrate by the speed that the solver leaves") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const float half = 0.1f, voxel = 0.2f / 32;
    Shape cube(exactBox({half, half, half}, voxel)), slab(exactBox({1.5f, 1.5f, 0.1f}, 4 * voxel));
    btStaticPlaneShape plane({0, 0, 1}, 0);
    btBoxShape box({1.5f, 1.5f, 0.1f});
    SquarePlate quad(1.5f);
    const struct {
        const char* name;
        btCollisionShape& shape;
        float top;
    } grounds[] = {{"plane", plane, 0}, {"box", box, 0.1f}, {"field", slab, 0.1f}, {"triangles", *quad.shape, 0}};
    for (const auto& ground : grounds)
        for (int i = 0; i < 40; ++i) {
            World world;
            const WorldExtensions guard(world.dynamics);
            world.dynamics.getSolverInfo().m_numIterations = 4;
            world.add(ground.shape, 0, {0, 0, -ground.top});
            const btVector3 axis = toBullet(random.direction());
            btRigidBody* body = world.add(cube, 1, {0, 0, 0.3f}, btQuaternion(axis, float(random(0, 0.1))));
            body->setLinearVelocity({float(random(-5, 5)), float(random(-5, 5)), -float(random(20, 80))});
            for (int n = 0; n < 6; ++n) {
                world.dynamics.stepSimulation(step, 0);
                CAPTURE(ground.name, i, n);
                CHECK(lowest(shapes::box({half, half, half}), body->getWorldTransform()) > -0.5f * voxel);
            }
        }
}

TEST_CASE("Fields without a margin are not passed through either") {
    Shape plate(exactBox({1.f, 1.f, 0.5f * h}, h), {.margin = 0}), ball(exactSphere(0.2f, h), {.margin = 0});
    btSphereShape sphere(0.2f);
    const bool isField = GENERATE(false, true);
    CAPTURE(isField);
    World world;
    const WorldExtensions guard(world.dynamics);
    world.add(plate, 0, {0, 0, 0});
    btRigidBody* body = world.add(isField ? static_cast<btCollisionShape&>(ball) : sphere, 1, {0.1f, 0.2f, 3});
    body->setLinearVelocity({0, 0, -300});
    for (int i = 0; i < 10; ++i) {
        world.dynamics.stepSimulation(step, 0);
        CHECK(body->getCenterOfMassPosition().z() > 0);
    }
}

TEST_CASE("A body that Bullet's own CCD stops is not placed on the far side of the obstacle") {
    Shape wall(exactBox({0.5f * h, 1.f, 1.f}, h));
    btSphereShape sphere(0.1f);
    btBoxShape box({0.05f, 0.05f, 0.05f});
    World world;
    const WorldExtensions guard(world.dynamics);
    world.dynamics.setGravity({0, 0, 0});
    world.add(wall, 0, {0, 0, 0});
    world.add(wall, 0, {0.8f, 0, 0});
    // hit in this very step: Bullet's speculative contacts use the velocity before the hit
    world.add(box, 1000, {0.149f, 0.1f, 0.2f})->setLinearVelocity({100, 0, 0});
    btRigidBody* body = world.add(sphere, 1, {0.3f, 0.1f, 0.2f});
    body->setCcdMotionThreshold(0.05f);
    body->setCcdSweptSphereRadius(0.08f);
    for (int i = 0; i < 10; ++i) {
        world.dynamics.stepSimulation(step, 0);
        CAPTURE(i, body->getCenterOfMassPosition().x());
        CHECK(body->getCenterOfMassPosition().x() > 0);
        CHECK(body->getCenterOfMassPosition().x() < 0.8f);
    }
}

TEST_CASE("Sliding, rolling and resting bodies are not stopped, and a world without extensions is unchanged") {
    Shape block(exactBox({0.3f, 0.3f, 0.2f}, h)), floor(exactBox({4, 1, 0.3f}, h)), ball(exactSphere(0.2f, h));
    World world;
    {
        const WorldExtensions guard(world.dynamics);
        world.add(floor, 0, {0, 0, -0.3f})->setFriction(0);
        btRigidBody *sliding = world.add(block, 1, {-3, -0.5f, 0.2f}), *rolling = world.add(ball, 1, {-3, 0.5f, 0.2f});
        sliding->setLinearVelocity({20, 0, 0});
        rolling->setLinearVelocity({20, 0, 0});
        rolling->setAngularVelocity({0, 100, 0});
        for (int i = 0; i < 60; ++i) {
            world.dynamics.stepSimulation(1 / 240.f, 0);
            CAPTURE(i);
            REQUIRE(guard.stoppedBodies() == 0);
        }
        CHECK(sliding->getCenterOfMassPosition().x() == Approx(2).margin(0.01));
        CHECK(rolling->getCenterOfMassPosition().x() == Approx(2).margin(0.02));
    }
    // its contacts are speculative again
    World fast;
    { const WorldExtensions guard(fast.dynamics); }
    fast.add(floor, 0, {0, 0, -0.3f});
    btRigidBody* body = fast.add(ball, 1, {0, 0, 3});
    body->setLinearVelocity({0, 0, -100});
    for (int i = 0; i < 2; ++i) fast.dynamics.stepSimulation(step, 0);
    CHECK(body->getCenterOfMassPosition().z() > 0.19f);
}
}  // namespace bilayer::continuous_collision_test
