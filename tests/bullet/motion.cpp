// SPDX-License-Identifier: Apache-2.0
// Bodies over many steps: rings on poles and in each other, slides, bounces, landings, and results that do not depend
// on the count of threads.
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <glm/trigonometric.hpp>

#include <bilayer/sdf/build.h>
#include "demos/shared/shapes.h"
#include "integration/bullet/detail/convert.h"
#include "tests/bullet/world.h"
#include "tests/support/random.h"
#include "tests/support/support.h"

namespace bilayer::motion_test {
using namespace bilayer::detail;
using namespace bilayer::bullet::detail;
using namespace bilayer::test;
using bullet::Shape;

namespace {

constexpr float h = 0.05f;  // voxel [m]

/// The transforms of a pile of bodies of several kinds after some steps, on a count of threads.
std::vector<float> pile(int threads) {
    static const auto torus = exactTorus(0.4f, 0.15f, h), box = exactBox({0.3f, 0.2f, 0.15f}, h),
                      bowl = exactBowl(2.f, 0.2f, 0.1f);
    tbb::global_control limit(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(threads));
    tbb::task_arena arena(threads);
    std::vector<float> state;
    arena.execute([&] {
        Shape torusShape(torus), boxShape(box), bowlShape(bowl);
        btSphereShape ball(0.2f);
        btCapsuleShape capsule(0.15f, 0.4f);
        btCompoundShape compound;
        compound.addChildShape(btTransform(btQuaternion::getIdentity(), {-0.2f, 0, 0}), &boxShape);
        compound.addChildShape(btTransform(btQuaternion::getIdentity(), {0.3f, 0, 0}), &ball);
        btCollisionShape* const kinds[] = {&torusShape, &boxShape, &ball, &capsule, &compound};
        World world;
        world.add(bowlShape, 0, {0, 0, 0});
        std::vector<btRigidBody*> bodies;
        for (int i = 0; i < 12; ++i)
            bodies.push_back(world.add(*kinds[i % 5], 1, {0.3f * (i % 3) - 0.3f, 0.1f * i - 0.6f, -1.f + 0.3f * i},
                                       btQuaternion(btVector3(1, 0.3f * i, 2).normalized(), 0.7f * i)));
        world.run(1.25f);
        for (const btRigidBody* body : bodies) {
            btScalar matrix[16];
            body->getWorldTransform().getOpenGLMatrix(matrix);
            state.insert(state.end(), matrix, matrix + 16);
        }
    });
    return state;
}

}  // namespace

TEST_CASE("Three hundred steps give the same bits on 1, 2 and 8 threads") {
    const std::vector<float> one = pile(1);
    for (float value : one) REQUIRE(std::isfinite(value));
    for (int threads : {2, 8}) {
        const std::vector<float> more = pile(threads);
        REQUIRE(more.size() == one.size());
        CHECK(std::memcmp(more.data(), one.data(), one.size() * sizeof(float)) == 0);
    }
}

TEST_CASE("A ring dropped over a pole stays on it and comes to rest on the ground") {
    const bool capsule = GENERATE(true, false);
    CAPTURE(capsule);
    Shape ring(exactTorus(0.5f, 0.15f, h));
    btCapsuleShapeZ roundPole(0.2f, 3);
    btCylinderShapeZ pole({0.2f, 0.2f, 1.7f});
    btStaticPlaneShape ground({0, 0, 1}, 0);
    World world;
    world.add(ground, 0, {0, 0, 0});
    world.add(capsule ? static_cast<btCollisionShape&>(roundPole) : pole, 0, {0, 0, 1.7f});
    btRigidBody* body = world.add(ring, 1, {0.1f, 0, 2.6f}, btQuaternion(btVector3(1, 0, 0), 0.3f));
    for (int i = 0; i < 40; ++i) {
        world.run(0.1f);
        const btVector3& at = body->getWorldTransform().getOrigin();
        CAPTURE(i, at.x(), at.y(), at.z());
        REQUIRE(std::hypot(at.x(), at.y()) < 0.5f);
        REQUIRE(at.z() > 0.14f);
    }
    CHECK(body->getWorldTransform().getOrigin().z() == Approx(0.15f).margin(0.1 * h));
    CHECK(motion(*body) < 1e-2f);
}

TEST_CASE("A ring hangs in another") {
    const auto collider = exactTorus(0.5f, 0.12f, 0.04f);
    Shape ring(collider);
    World world;
    // the fixed ring is upright in the xz plane; the other hangs across its lowest part
    world.add(ring, 0, {0, 0, 0}, btQuaternion(btVector3(1, 0, 0), SIMD_HALF_PI));
    btRigidBody* body = world.add(ring, 1, {0, 0, -0.85f}, btQuaternion(btVector3(0, 1, 0), SIMD_HALF_PI));
    world.run(4);
    const btVector3& at = body->getWorldTransform().getOrigin();
    // it hangs with the inside of its tube on the inside of the other's: 2 (R - r)
    CAPTURE(at.x(), at.y(), at.z());
    CHECK(at.z() == Approx(-2 * (0.5f - 0.12f)).margin(0.2 * 0.04));
    CHECK(std::hypot(at.x(), at.y()) < 0.05f);
    CHECK(motion(*body) < 0.05f);
}

TEST_CASE("A body on a slope sticks or slides by friction") {
    const float friction = GENERATE(0.7f, 0.3f);  // of the pair: the product of both coefficients
    const float slope = std::atan(0.5f);
    Shape block(exactBox({0.3f, 0.3f, 0.2f}, h)), ramp(exactBox({2, 1, 0.3f}, h));
    World world;
    const btQuaternion tilt(btVector3(0, 1, 0), slope);
    world.add(ramp, 0, {0, 0, 0}, tilt)->setFriction(1);
    const btVector3 start = quatRotate(tilt, {-1.2f, 0, 0.5f});
    btRigidBody* body = world.add(block, 1, start, tilt);
    body->setFriction(friction);
    world.run(0.5f);
    const float way = (body->getWorldTransform().getOrigin() - start).length();
    CAPTURE(friction, way);
    if (friction > 0.5f)
        CHECK(way < 0.2f * h);
    else
        CHECK(way == Approx(0.5f * 9.81f * (std::sin(slope) - friction * std::cos(slope)) * 0.25f).epsilon(0.03));
}

TEST_CASE("Falling bodies bounce with their restitution, wherever a step ends") {
    const float perSecond = GENERATE(60.f, 240.f), restitution = GENERATE(0.5f, 0.9f);
    const int kind = GENERATE(0, 1, 2);
    CAPTURE(perSecond, restitution, kind);
    Shape fieldFloor(exactBox({1, 1, 0.2f}, h)), fieldBox(exactBox({0.1f, 0.1f, 0.1f}, h));
    btBoxShape boxFloor({1, 1, 0.2f});
    btSphereShape ball(0.1f);
    double sum = 0;
    constexpr int drops = 20;
    for (int drop = 0; drop < drops; ++drop) {
        World world;
        world.add(kind == 2 ? static_cast<btCollisionShape&>(boxFloor) : fieldFloor, 0, {0, 0, -0.2f})
            ->setRestitution(1);
        btRigidBody* body = world.add(kind == 0 ? static_cast<btCollisionShape&>(ball) : fieldBox, 1,
                                      {0, 0, 0.6f + 0.04f * float(drop)});
        body->setRestitution(restitution);
        body->setDamping(0, 0);
        float fastest = 0, rebound = 0;
        for (int i = 0; i < int(perSecond) && rebound == 0; ++i) {
            world.dynamics.stepSimulation(1 / perSecond, 1, 1 / perSecond);
            const float speed = body->getLinearVelocity().z();
            fastest = std::max(fastest, -speed);
            rebound = std::max(rebound, speed);
        }
        sum += double(rebound / fastest) / drops;
        // the solver may remove the speed that gravity adds in the step of the bounce
        CHECK(rebound / fastest == Approx(restitution).margin(1.1 * 9.81 / double(perSecond * fastest)));
    }
    CHECK(sum == Approx(restitution).margin(0.02));
}

TEST_CASE("Bodies with vertices and edges come to rest in a groove of triangles of any size") {
    const unsigned seed = test::seed();
    const float cell = GENERATE(0.9f, 12.f);  // [voxels]
    const bool hasTips = GENERATE(true, false);
    CAPTURE(seed, cell, hasTips);
    Random random(seed);
    const float voxel = 0.02f, slope = 0.6f, length = 0.3f;
    const Mesh mesh = hasTips
                          ? shapes::revolve({{0, -0.15f}, {0.03f, -0.03f}, {0.15f, 0}, {0.03f, 0.03f}, {0, 0.15f}}, 12)
                          : shapes::box({0.09f, 0.09f, 0.09f});
    Shape shape(std::make_shared<Collider>(mesh, build(mesh, {.voxelSize = voxel})));
    TriangleShape groove(grooveOf(slope, cell * voxel, cell > 1 ? 3 : 30));
    for (int i = 0; i < 3; ++i) {
        World world;
        world.add(*groove.shape, 0, {0, 0, 0});
        btRigidBody* body = world.add(shape, 1, {float(random(-0.1, 0.1)), float(random(-0.1, 0.1)), 1.2f * length},
                                      btQuaternion(bullet::detail::toBullet(random.direction()), float(random(0, 6))));
        body->setDamping(0.05f, 0.2f);
        world.run(3);
        float least = 0;
        for (const glm::vec3& point : mesh.points) {
            const btVector3 place = body->getWorldTransform() * bullet::detail::toBullet(point);
            least = std::min(least, (place.z() - slope * std::abs(place.x())) / std::sqrt(1 + slope * slope));
        }
        CHECK(least > -0.1f * voxel);
    }
}

TEST_CASE("Thin bodies rest on triangles, and their far side does not pull them through") {
    const float degrees = GENERATE(5.f, 10.f, 20.f), voxel = GENERATE(0.02f, 0.01f);
    const ContactAccuracy accuracy = GENERATE(ContactAccuracy::exactNearFeatures, ContactAccuracy::exact);
    const unsigned seed = test::seed();
    CAPTURE(degrees, voxel, nameOf(accuracy), seed);
    Random random(seed);
    const float half = glm::radians(0.5f * degrees), y = 0.3f, z = y * std::tan(half);
    Mesh wedge;
    wedge.points = {{-0.4f, 0, 0}, {0.4f, 0, 0}, {0.4f, y, z}, {-0.4f, y, z}, {0.4f, y, -z}, {-0.4f, y, -z}};
    wedge.triangles = {{0, 3, 2}, {0, 2, 1}, {0, 1, 4}, {0, 4, 5}, {3, 5, 4}, {3, 4, 2}, {0, 5, 3}, {1, 2, 4}};
    const auto collider =
        std::make_shared<Collider>(wedge, build(wedge, {.voxelSize = voxel}), ColliderOptions{.accuracy = accuracy});
    const Pose frame = bullet::centreOfMassFrame(*collider);
    Shape shape(collider, {.frame = frame});
    Mesh sheet;
    sheet.points = {{-2, -2, 0}, {2, -2, 0}, {2, 2, 0}, {-2, 2, 0}};
    sheet.triangles = {{0, 1, 2}, {0, 2, 3}};
    TriangleShape ground(sheet);
    for (int i = 0; i < 4; ++i) {
        World world;
        world.add(*ground.shape, 0, {0, 0, 0});
        const btTransform ofMesh(bullet::detail::toBullet(frame.rotation), bullet::detail::toBullet(frame.position));
        btTransform pose(btQuaternion({0, 0, 1}, float(random(0, 6))) *
                         btQuaternion({1, 0, 0}, half + float(random(0, 0.03))));
        pose.getOrigin().setZ(0.1f * voxel - lowest(wedge, pose));
        btRigidBody* body = world.add(shape, 1, {0, 0, 0});
        body->setWorldTransform(pose * ofMesh.inverse());
        body->setInterpolationWorldTransform(body->getWorldTransform());
        body->setActivationState(DISABLE_DEACTIVATION);
        world.run(0.5f);
        CHECK(lowest(wedge, body->getWorldTransform() * ofMesh) > -0.1f * voxel);
    }
}

TEST_CASE("Bodies that fall flat without friction do not drift sideways") {
    const unsigned seed = test::seed();
    Random random(seed);
    const float voxel = float(random(0.006, 0.03));
    CAPTURE(seed, voxel);
    Shape slab(exactBox({1, 1, 0.1f}, voxel)), cube(exactBox({0.1f, 0.1f, 0.1f}, voxel));
    btBoxShape box({0.1f, 0.1f, 0.1f}), ground({1, 1, 0.1f});
    btCylinderShapeZ cylinder({0.1f, 0.1f, 0.1f});
    const struct {
        const char* name;
        btCollisionShape &falling, &ground;
    } pairs[] = {{"box on field", box, slab},
                 {"cylinder on field", cylinder, slab},
                 {"field on field", cube, slab},
                 {"field on box", cube, ground}};
    for (const auto& pair : pairs)
        for (int i = 0; i < 60; ++i) {
            CAPTURE(pair.name, i);
            World world;
            world.add(pair.ground, 0, {0, 0, 0});
            const btVector3 place(float(random(-0.5, 0.5)), float(random(-0.5, 0.5)), 0.2f + float(random(0, 0.6)));
            btRigidBody* body =
                world.add(pair.falling, 1, place, btQuaternion(btVector3(0, 0, 1), float(random(0, 3))));
            body->setFriction(0);
            body->setActivationState(DISABLE_DEACTIVATION);
            for (int step = 0; step < 60; ++step) world.dynamics.stepSimulation(1 / 60.f, 0);
            const btVector3 velocity = body->getLinearVelocity(), at = body->getCenterOfMassPosition();
            CAPTURE(place.x(), place.y(), place.z());
            CHECK(std::hypot(velocity.x(), velocity.y()) < 1e-3f);
            CHECK(std::hypot(at.x() - place.x(), at.y() - place.y()) < 1e-3f);
        }
}
}  // namespace bilayer::motion_test
