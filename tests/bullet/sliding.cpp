// SPDX-License-Identifier: Apache-2.0
// Bodies slide according to friction, on every kind of ground.
#include <BulletCollision/CollisionShapes/btHeightfieldTerrainShape.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <glm/trigonometric.hpp>
#include <utility>
#include <vector>

#include <bilayer/integration/bullet/extensions.h>
#include <bilayer/sdf/build.h>
#include "demos/shared/shapes.h"
#include "demos/shared/waves.h"
#include "demos/shared/world.h"
#include "tests/bullet/world.h"
#include "tests/support/random.h"
#include "tests/support/support.h"

namespace bilayer::sliding_test {
using namespace bilayer::test;
using bullet::Shape;

namespace {

/// An upright prism with a cross-shaped outline: at its inner corners edges of all directions meet.
Mesh crossPrism(float arm, float halfHeight) {
    const glm::vec2 quarter[] = {{1, -0.4f}, {1, 0.4f}, {0.4f, 0.4f}};
    Mesh mesh;
    for (const float z : {-halfHeight, halfHeight}) {
        mesh.points.emplace_back(0, 0, z);
        for (int turn = 0; turn < 4; ++turn)
            for (const glm::vec2& p : quarter) {
                const glm::vec2 turned[] = {p, {-p.y, p.x}, -p, {p.y, -p.x}};
                mesh.points.emplace_back(arm * turned[turn], z);
            }
    }
    for (unsigned i = 1, next = 2; i <= 12; ++i, next = i % 12 + 1) {
        mesh.triangles.push_back({0, next, i});
        mesh.triangles.push_back({13, 13 + i, 13 + next});
        mesh.triangles.push_back({i, next, 13 + next});
        mesh.triangles.push_back({i, 13 + next, 13 + i});
    }
    return mesh;
}

constexpr float half = 4;  // of all grounds, whose tops are at 0 [m]

/// Grounds of all kinds.
struct Grounds {
    btStaticPlaneShape plane{{0, 0, 1}, 0};
    btBoxShape box{{half, half, 0.2f}};
    btCylinderShapeZ cylinder{{1.5f * half, 1.5f * half, 0.2f}};
    btConvexHullShape hull;
    TriangleShape twoTriangles{shapes::box({half, half, 0.2f})}, manyTriangles{shapes::box({half, half, 0.2f}, 40)};
    std::vector<float> heights = std::vector<float>(33 * 33, 0.f);
    btHeightfieldTerrainShape heightfield{33, 33, heights.data(), 1, -1, 1, 2, PHY_FLOAT, false};
    Shape field{exactBox({half, half, 0.2f}, 0.04f)};

    Grounds() {
        heightfield.setLocalScaling({0.25f, 0.25f, 1});
        for (const glm::vec3& point : shapes::box({half, half, 0.2f}, 4).points)
            hull.addPoint(bullet::detail::toBullet(point));
        hull.setMargin(0);
    }

    struct Ground {
        const char* name;
        btCollisionShape& shape;
        float top;  ///< height of the top above the shape's origin [m]
    };
    std::vector<Ground> all() {
        return {{"plane", plane, 0},
                {"box", box, 0.2f},
                {"cylinder", cylinder, 0.2f},
                {"hull", hull, 0.2f},
                {"large triangles", *twoTriangles.shape, 0.2f},
                {"small triangles", *manyTriangles.shape, 0.2f},
                {"height field", heightfield, 0},
                {"field", field, 0.2f}};
    }
};

}  // namespace

TEST_CASE("Bodies with a flat base slide to a stop by friction, on all flat shapes") {
    const float steps = GENERATE(60.f, 240.f), voxel = GENERATE(0.01f, 0.004f);
    const unsigned seed = test::seed();
    CAPTURE(seed, steps, voxel);
    Random random(seed);
    const float edge = 0.1f;  // half the edge length of the bodies [m]
    Shape cube(exactBox(glm::vec3(edge), voxel));
    const Mesh mesh = crossPrism(2 * edge, edge);
    Shape cross(std::make_shared<Collider>(mesh, build(mesh, {.voxelSize = voxel, .interiorWidthVoxels = 6})));
    btBoxShape box(btVector3(edge, edge, edge));
    const struct {
        const char* name;
        btCollisionShape& shape;
    } bodies[] = {{"cube", cube}, {"cross", cross}, {"Bullet's box", box}};
    Grounds grounds;
    for (const auto& kind : bodies)
        for (const auto& ground : grounds.all()) {
            if (&kind.shape == &box && &ground.shape != &grounds.field) continue;
            CAPTURE(kind.name, ground.name);
            World world;
            world.add(ground.shape, 0, {0, 0, -ground.top});
            const float start = float(random(-2, 0));
            btRigidBody* body = world.add(kind.shape, 1, {start, float(random(-1, 1)), edge},
                                          btQuaternion(btVector3(0, 0, 1), float(random(0, 3))));
            // Bullet multiplies the coefficients of both bodies; the ground has 0.5
            body->setFriction(0.5f);
            body->setDamping(0, 0);
            const float speed = float(random(1, 3));
            body->setLinearVelocity({speed, 0, 0});
            float highest = 0;
            for (float time = 0; time < 2; time += 1 / steps) {
                world.dynamics.stepSimulation(1 / steps, 0);
                highest = std::max(highest, float(body->getWorldTransform().getOrigin().z()) - edge);
            }
            // each step applies friction before its displacement
            const float deceleration = 0.25f * 9.81f, way = speed * speed / (2 * deceleration) - speed / (2 * steps);
            CHECK(body->getWorldTransform().getOrigin().x() - start == Approx(way).epsilon(0.02).margin(0.01));
            CHECK(highest < 0.1f * voxel);
        }
}

TEST_CASE("Contacts with flat shapes have the shape's normal, for slightly tilted bodies too") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const float voxel = 0.01f, edge = 0.1f;
    const Mesh mesh = crossPrism(2 * edge, edge);
    Shape cross(std::make_shared<Collider>(mesh, build(mesh, {.voxelSize = voxel, .interiorWidthVoxels = 6})));
    Grounds grounds;
    for (const auto& ground : grounds.all()) {
        CAPTURE(ground.name);
        World world;
        world.dynamics.setGravity({0, 0, 0});
        world.add(ground.shape, 0, {0, 0, -ground.top});
        btRigidBody* body = world.add(cross, 1, {0, 0, 1});
        int contacts = 0;
        for (int i = 0; i < 100; ++i) {
            CAPTURE(i);
            const btVector3 aside(float(random(-1, 1)), float(random(-1, 1)), 0);
            btTransform at(btQuaternion(aside.normalized(), i % 2 ? float(random(0, 0.006)) : 0) *
                           btQuaternion(btVector3(0, 0, 1), float(random(0, 3))));
            const float height = voxel * std::pow(10.f, -float(random(2, 6)));
            at.setOrigin({float(random(-1, 1)), float(random(-1, 1)), height - lowest(mesh, at)});
            body->setWorldTransform(at);
            body->setInterpolationWorldTransform(at);
            body->setLinearVelocity(2 * aside.normalized());
            body->setAngularVelocity({0, 0, 0});
            world.dynamics.stepSimulation(1 / 60.f, 0);
            for (int m = 0; m < world.dispatcher.getNumManifolds(); ++m) {
                const btPersistentManifold& manifold = *world.dispatcher.getManifoldByIndexInternal(m);
                for (int k = 0; k < manifold.getNumContacts(); ++k, ++contacts)
                    REQUIRE(std::abs(manifold.getContactPoint(k).m_normalWorldOnB.z()) > 0.9998f);
            }
        }
        CHECK(contacts > 100);
    }
}

TEST_CASE("Bodies with a round base keep their speed without friction") {
    const float steps = GENERATE(60.f, 240.f);
    const unsigned seed = test::seed();
    CAPTURE(seed, steps);
    Random random(seed);
    Shape ball(exactSphere(0.1f, 0.01f)), ring(exactTorus(0.1f, 0.04f, 0.01f));
    const struct {
        const char* name;
        btCollisionShape& shape;
        float height;
    } bodies[] = {{"ball", ball, 0.1f}, {"ring", ring, 0.04f}};
    Grounds grounds;
    for (const auto& kind : bodies)
        for (const auto& ground : grounds.all()) {
            // the curved paths of points that are about to touch are approximated as straight
            if (&ground.shape == &grounds.field) continue;
            if (steps < 100 && &ground.shape != &grounds.plane && &ground.shape != &grounds.box) continue;
            CAPTURE(kind.name, ground.name);
            World world;
            world.add(ground.shape, 0, {0, 0, -ground.top});
            btRigidBody* body = world.add(kind.shape, 1, {-2, float(random(-1, 1)), kind.height},
                                          btQuaternion(btVector3(0, 0, 1), float(random(0, 3))));
            body->setFriction(0);
            body->setDamping(0, 0);
            body->setLinearVelocity({2, 0, 0});
            for (float time = 0; time < 1; time += 1 / steps) world.dynamics.stepSimulation(1 / steps, 0);
            CHECK(body->getLinearVelocity().x() == Approx(2).epsilon(0.03));  // for a ball, 2 % for a box
            CHECK(body->getWorldTransform().getOrigin().z() == Approx(kind.height).margin(0.002));
        }
}

namespace {

/// Waves of 0.1 m, 8 m long and 4 m wide, of squares of two triangles each.
Mesh waves(float cell) {
    const int columns = int(8 / cell), rows = int(4 / cell);
    Mesh mesh;
    for (int j = 0; j <= rows; ++j)
        for (int i = 0; i <= columns; ++i) {
            const float x = cell * float(i) - 4, y = cell * float(j) - 2;
            mesh.points.push_back({x, y, 0.1f * std::sin(2.1f * x + 1) * std::cos(1.3f * y)});
        }
    const auto row = unsigned(columns + 1);
    for (unsigned j = 0; j < unsigned(rows); ++j)
        for (unsigned i = 0; i + 1 < row; ++i) {
            const unsigned a = j * row + i, b = a + 1, c = a + row;
            mesh.triangles.push_back({a, b, c});
            mesh.triangles.push_back({b, c + 1, c});
        }
    return mesh;
}

/// The energy of a body of 1 kg that slides over waves without friction, and its maximum loss in one step.
struct Slide {
    float start = 0, end = 0;  ///< after it has landed, and at the end [J]
    float kinetic = 0;         ///< at the start [J]
    float maxLoss = 0;         ///< [J]
};

Slide slide(btCollisionShape& ground, btCollisionShape& shape, float height, float y, float steps, float seconds) {
    World world;
    const bullet::WorldExtensions extensions(world.dynamics);
    world.add(ground, 0, {0, 0, 0});
    btRigidBody* body = world.add(shape, 1, {-3, y, height + 0.1f});
    body->setFriction(0);
    body->setDamping(0, 0);
    body->setActivationState(DISABLE_DEACTIVATION);
    body->setLinearVelocity({2, 0, 0});
    body->setLinearFactor({1, 0, 1});
    const auto kinetic = [&] { return float(demo::kineticEnergyOf(*body)); };
    const auto energy = [&] { return kinetic() + 9.81f * float(body->getCenterOfMassPosition().z()); };
    Slide slide;
    for (int i = 0; float(i) < seconds * steps; ++i) {
        const float before = energy();
        world.dynamics.stepSimulation(1 / steps, 0);
        if (float(i) < 0.6f * steps)
            slide.start = energy(), slide.kinetic = kinetic();
        else
            slide.maxLoss = std::max(slide.maxLoss, before - energy());
    }
    slide.end = energy();
    return slide;
}

/// Calls found(place on the ground, place on the body, normal away from the ground) for each contact.
template <class Found>
void forContactsOn(const btRigidBody& ground, btDispatcher& dispatcher, Found&& found) {
    for (int m = 0; m < dispatcher.getNumManifolds(); ++m) {
        const btPersistentManifold& manifold = *dispatcher.getManifoldByIndexInternal(m);
        const bool isFirst = manifold.getBody0() == &ground;
        if (!isFirst && manifold.getBody1() != &ground) continue;
        for (int i = 0; i < manifold.getNumContacts(); ++i) {
            const btManifoldPoint& point = manifold.getContactPoint(i);
            const btVector3 onA = point.getPositionWorldOnA(), onB = point.getPositionWorldOnB();
            const btVector3 alongNormal = onB + point.getDistance() * point.m_normalWorldOnB;
            if (isFirst)
                found(onA, alongNormal, -point.m_normalWorldOnB);
            else
                found(onB, onA, point.m_normalWorldOnB);
        }
    }
}

}  // namespace

TEST_CASE("A body that slides over high waves is not stopped at an edge of the ground") {
    const auto [cell, steps] = GENERATE(std::pair(0.15f, 60.f), std::pair(0.25f, 60.f), std::pair(0.25f, 240.f),
                                        std::pair(0.6f, 60.f), std::pair(0.6f, 240.f));
    const unsigned seed = test::seed();
    CAPTURE(cell, steps, seed);
    Random random(seed);
    TriangleShape ground(waves(cell));
    Shape block(exactBox({0.3f, 0.3f, 0.15f}, 0.0125f)), ball(exactSphere(0.25f, 0.0125f));
    for (int i = 0; i < 6; ++i) {
        const float y = float(random(-1, 1));
        CAPTURE(i, y);
        // An edge of 15 degrees takes 7 % of the energy, 0.2 J.
        CHECK(slide(*ground.shape, block, 0.15f, y, steps, 2.5f).maxLoss < 0.3f);
        CHECK(slide(*ground.shape, ball, 0.25f, y, steps, 2.5f).maxLoss < 0.3f);
    }
}

TEST_CASE("A body that slides over smooth high waves keeps its speed without friction") {
    const float steps = GENERATE(60.f, 240.f);
    CAPTURE(steps);
    TriangleShape ground(waves(0.04f));
    Shape block(exactBox({0.3f, 0.3f, 0.15f}, 0.0125f));
    const Slide result = slide(*ground.shape, block, 0.15f, 0.13f, steps, 2);
    CHECK(result.end == Approx(result.start).margin(0.04f * result.kinetic));  // 2 % of the speed
}

TEST_CASE("Contacts with waves have normals of the triangles around them, however far a body rotates in a step") {
    const unsigned seed = test::seed();
    Random random(seed);
    Shape block(exactBox({0.3f, 0.3f, 0.15f}, 0.0125f)), ball(exactSphere(0.25f, 0.0125f));
    for (int i = 0; i < 8; ++i) {
        const float height = float(random(0.05, 0.1)), cell = float(random(0.15, 1.5));
        CAPTURE(seed, i, height, cell);
        const demo::Waves waves({height, cell});
        const auto shape = waves.shape();
        World world;
        const btRigidBody* ground = world.add(*shape, 0, {0, 0, 0});
        for (int k = 0; k < 6; ++k) {
            const btVector3 place(float(random(-6, -5)), float(k) - 2.5f, height + 0.25f);
            btRigidBody* body = world.add(k < 4 ? block : ball, 1, place);
            body->setFriction(k % 2 ? 0 : 1);
            body->setLinearVelocity({float(random(1, 3)), 0, 0});
        }
        int oblique = 0;
        for (int step = 0; step < 120; ++step) {
            world.dynamics.stepSimulation(1 / 60.f, 0);
            forContactsOn(*ground, world.dispatcher,
                          [&](const btVector3& onGround, const btVector3& onBody, const btVector3& normal) {
                              const auto angleAt = [&](const btVector3& place) {
                                  const glm::dvec3 at(place.x(), place.y(), place.z()),
                                      up(normal.x(), normal.y(), normal.z());
                                  return waves.angleToNormals(at, up, 0.25 * 0.0125);
                              };
                              oblique += std::min(angleAt(onGround), angleAt(onBody)) > glm::radians(5.0);
                          });
        }
        CHECK(oblique == 0);
    }
}
}  // namespace bilayer::sliding_test
