// SPDX-License-Identifier: Apache-2.0
// Bodies keep their energy over triangles that stand for smooth ground, and only there.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <glm/trigonometric.hpp>
#include <memory>
#include <vector>

#include <bilayer/integration/bullet/extensions.h>
#include "collider/contact/open_surface/smooth_edge_angle.h"
#include "demos/shared/shapes.h"
#include "demos/shared/waves.h"
#include "demos/shared/world.h"
#include "integration/bullet/detail/smooth_ground.h"
#include "tests/bullet/world.h"
#include "tests/support/random.h"
#include "tests/support/support.h"

namespace bilayer::smooth_ground_test {
using namespace bilayer::test;
using bullet::Shape;
using bullet::WorldExtensions;
using bullet::detail::FacetFriction;
using bullet::detail::FacetImpact;
using demo::kineticEnergyOf;

namespace {

constexpr float gravity = 9.81f, voxel = 0.0125f;  // [m/s^2], [m]

/// A body of 1 kg that moves over ground without friction, along x.
struct Slider {
    World world;
    btRigidBody* body;

    Slider(btCollisionShape& ground, btCollisionShape& shape, const btVector3& at, const btVector3& velocity) {
        world.add(ground, 0, {0, 0, 0});
        body = world.add(shape, 1, at);
        body->setFriction(0);
        body->setDamping(0, 0);
        body->setActivationState(DISABLE_DEACTIVATION);
        body->setLinearVelocity(velocity);
        body->setLinearFactor({1, 0, 1});
    }
    double energy() const {
        return kineticEnergyOf(*body) + double(gravity) * double(body->getCenterOfMassPosition().z());
    }
    void run(float seconds, float stepsPerSecond) {
        for (int i = 0; i < int(seconds * stepsPerSecond); ++i) world.dynamics.stepSimulation(1 / stepsPerSecond, 0);
    }
};

/// The part of its kinetic energy that a body loses in two seconds over waves.
double lossOver(const demo::Waves& waves, btCollisionShape& shape, float height, float y, float stepsPerSecond,
                bool smoothGround) {
    const auto ground = waves.shape();
    Slider slider(*ground, shape, {-5, y, height + waves.highestAround(-5, y, 0.45f)}, {2, 0, 0});
    const WorldExtensions extensions(slider.world.dynamics, {.smoothGround = smoothGround});
    slider.run(0.5f, stepsPerSecond);
    const double start = slider.energy(), kinetic = kineticEnergyOf(*slider.body);
    slider.run(2, stepsPerSecond);
    return (start - slider.energy()) / kinetic;
}

}  // namespace

TEST_CASE("Bodies keep their energy over waves of triangles of any size, at any step") {
    const unsigned seed = test::seed();
    Random random(seed);
    Shape block(exactBox({0.3f, 0.3f, 0.15f}, voxel)), ball(exactSphere(0.25f, voxel));
    double sum = 0, sumWithout = 0;
    for (int i = 0; i < 12; ++i) {
        const float height = float(random(0.03, 0.1)), cell = float(std::exp(random(std::log(0.15), std::log(1.2))));
        const float steps = float(60 << i % 4), y = float(random(-1, 1));
        const bool isBlock = i % 3;
        CAPTURE(seed, i, height, cell, steps, y, isBlock);
        const demo::Waves waves({height, cell, i % 2 > 0});
        btCollisionShape& shape = isBlock ? block : ball;
        const float top = isBlock ? 0.15f : 0.25f;
        const double loss = lossOver(waves, shape, top, y, steps, true);
        CHECK(std::abs(loss) < 0.04);  // 2 % of the speed
        sum += std::abs(loss);
        sumWithout += lossOver(waves, shape, top, y, steps, false);
    }
    CAPTURE(seed);
    CHECK(sum < 0.1 * sumWithout);
}

TEST_CASE("Slow blocks that tip over crests, and fast ones that fly over them, keep their energy") {
    const unsigned seed = test::seed();
    Random random(seed);
    Shape block(exactBox({0.3f, 0.3f, 0.15f}, voxel));
    double sum = 0, sumWithout = 0;
    for (int i = 0; i < 12; ++i) {
        const float angle = float(random(0.08, 0.34)), steps = float(120 << i % 2);
        const float speed = float(i % 3 ? random(0.5, 2.5) : random(0.3, 0.5));
        CAPTURE(seed, i, angle, speed, steps);
        // a flat ground that falls off beyond a crest
        const float slope = std::tan(angle);
        TriangleShape ground({{{-3, -2, 0}, {0, -2, 0}, {0, 2, 0}, {-3, 2, 0}, {9, -2, -9 * slope}, {9, 2, -9 * slope}},
                              {{0, 1, 2}, {0, 2, 3}, {1, 4, 5}, {1, 5, 2}}});
        const auto lossOf = [&](bool smoothGround) {
            Slider slider(*ground.shape, block, {-0.5f, 0, 0.15f}, {speed, 0, 0});
            const WorldExtensions extensions(slider.world.dynamics, {.smoothGround = smoothGround});
            const double start = slider.energy();
            for (int step = 0; slider.body->getCenterOfMassPosition().x() < 1; ++step) {
                REQUIRE(float(step) < 4 / speed * steps);
                slider.world.dynamics.stepSimulation(1 / steps, 0);
            }
            return (start - slider.energy()) / kineticEnergyOf(*slider.body);
        };
        const double loss = lossOf(true);
        CHECK(std::abs(loss) < 0.04);  // 2 % of the speed
        sum += std::abs(loss);
        sumWithout += lossOf(false);
    }
    CAPTURE(seed);
    CHECK(sum < 0.2 * sumWithout);
}

TEST_CASE("Ground in a compound, and kinematic ground that does not move, are smooth, too") {
    Shape block(exactBox({0.3f, 0.3f, 0.15f}, voxel));
    const demo::Waves waves({0.1f, 0.25f});
    const auto ground = waves.shape();
    btCompoundShape inner, outer;
    const btTransform turned(btQuaternion({0, 0, 1}, SIMD_HALF_PI), {1, 2, 3});
    inner.addChildShape(turned, ground.get());
    outer.addChildShape(turned.inverse(), &inner);
    const auto lossOn = [&](btCollisionShape& shape, bool isKinematic, bool smoothGround) {
        Slider slider(shape, block, {-5, 0.2f, 0.15f + waves.highestAround(-5, 0.2f, 0.45f)}, {2, 0, 0});
        btCollisionObject* const mesh = slider.world.dynamics.getCollisionObjectArray()[0];
        if (isKinematic) {
            mesh->setCollisionFlags(mesh->getCollisionFlags() | btCollisionObject::CF_KINEMATIC_OBJECT);
            mesh->setActivationState(DISABLE_DEACTIVATION);
        }
        const WorldExtensions extensions(slider.world.dynamics, {.smoothGround = smoothGround});
        slider.run(0.5f, 240);
        const double start = slider.energy(), kinetic = kineticEnergyOf(*slider.body);
        slider.run(2, 240);
        return (start - slider.energy()) / kinetic;
    };
    for (const bool isKinematic : {false, true}) {
        btCollisionShape& shape = isKinematic ? *ground : static_cast<btCollisionShape&>(outer);
        CHECK(std::abs(lossOn(shape, isKinematic, true)) < 0.04);  // 2 % of the speed
        CHECK(lossOn(shape, isKinematic, false) > 0.1);
    }
}

TEST_CASE("Balls that roll over triangles, flat ones or waves, keep their energy") {
    const unsigned seed = test::seed();
    Random random(seed);
    double sum = 0, sumWithout = 0;
    for (int i = 0; i < 12; ++i) {
        const float radius = float(random(0.15, 0.3)), speed = float(random(1, 2.5)), y = float(random(-1, 1));
        const float height = i % 2 ? float(random(0, 0.1)) : 0, steps = float(60 << i / 2 % 3);
        CAPTURE(seed, i, radius, speed, y, height, steps);
        Shape ball(exactSphere(radius, voxel));
        const demo::Waves waves({height, float(random(0.2, 0.6))});
        const auto ground = waves.shape();
        const auto lossOf = [&](bool smoothGround) {
            Slider slider(*ground, ball, {-5, y, waves.highestAround(-5, y, radius) + radius}, {speed, 0, 0});
            slider.body->setFriction(1);
            slider.body->setAngularFactor({0, 1, 0});
            slider.body->setAngularVelocity({0, speed / radius, 0});
            const WorldExtensions extensions(slider.world.dynamics, {.smoothGround = smoothGround});
            slider.run(0.25f, steps);
            const double start = slider.energy(), kinetic = kineticEnergyOf(*slider.body);
            slider.run(1.5f, steps);
            return (start - slider.energy()) / kinetic;
        };
        const double loss = lossOf(true);
        CHECK(std::abs(loss) < 0.04);  // 2 % of the speed
        sum += std::abs(loss);
        sumWithout += lossOf(false);
    }
    CAPTURE(seed);
    CHECK(sumWithout > 12 * 0.1);
    CHECK(sum < 0.1 * sumWithout);
}

TEST_CASE("A ball that slides over flat triangles until it rolls loses what friction takes") {
    const unsigned seed = test::seed();
    Random random(seed);
    Shape ball(exactSphere(0.25f, voxel));
    const demo::Waves flat({0, 0.25f});
    const auto ground = flat.shape();
    for (const float steps : {60.f, 120.f, 240.f}) {
        const float speed = float(random(1.5, 2.5)), y = float(random(-1, 1));
        CAPTURE(seed, steps, speed, y);
        Slider slider(*ground, ball, {-5, y, 0.25f}, {speed, 0, 0});
        // On a vertex. In the middle of a facet, friction would first have to tip the ball over the facet's front edge,
        // which takes 1.2 % of its speed.
        slider.body->getWorldTransform().setRotation(btQuaternion({0, 1, 0}, 0.0668f));
        slider.body->setFriction(1);
        slider.world.dynamics.getCollisionObjectArray()[0]->setFriction(0.4f);
        const WorldExtensions extensions(slider.world.dynamics);
        slider.run(0.5f, steps);
        const float rolling = slider.body->getLinearVelocity().x();
        CAPTURE(rolling);
        slider.run(1, steps);
        CHECK(slider.body->getLinearVelocity().x() == Approx(5 * speed / 7).epsilon(0.02));
    }
}

TEST_CASE("Ground that moves gives bodies nothing") {
    Shape ball(exactSphere(0.25f, voxel));
    const demo::Waves waves({0.1f, 0.25f});
    const auto ground = waves.shape();
    const auto end = [&](bool smoothGround) {
        Slider slider(*ground, ball, {-5, 0.3f, 0.35f}, {2, 0, 0});
        btCollisionObject* const mesh = slider.world.dynamics.getCollisionObjectArray()[0];
        mesh->setCollisionFlags(mesh->getCollisionFlags() | btCollisionObject::CF_KINEMATIC_OBJECT);
        mesh->setActivationState(DISABLE_DEACTIVATION);
        const WorldExtensions extensions(slider.world.dynamics, {.smoothGround = smoothGround});
        for (int i = 0; i < 120; ++i) {
            mesh->getWorldTransform().getOrigin().setZ(0.001f * float(i));
            slider.run(1.f / 120, 120);
        }
        return slider.body->getWorldTransform();
    };
    CHECK(end(true) == end(false));
}

TEST_CASE("The turn at a point of a mesh is that of the edges of its triangle, if they are smooth") {
    const auto turnAt = [](const Mesh& mesh, const glm::vec3& point) {
        return glm::degrees(detail::smoothEdgeAngleAt(detail::MeshTree(mesh, voxel), point));
    };
    CHECK(turnAt(shapes::cylinder(0.2f, 0.4f, 96), {0.2f, 0.01f, 0.05f}) == Approx(3.75f).epsilon(1e-3));
    CHECK(turnAt(shapes::cylinder(0.2f, 0.4f, 12), {0.2f, 0.01f, 0.05f}) == 0);
    CHECK(turnAt(shapes::box({0.3f, 0.3f, 0.1f}), {0.1f, 0.05f, 0.1f}) == 0);
    CHECK(turnAt(shapes::sphere(0.2f), {0, 0.5f, 0}) == 0);  // not near its surface
}

TEST_CASE("A body that drops on waves loses its speed there") {
    const unsigned seed = test::seed();
    Random random(seed);
    Shape ball(exactSphere(0.25f, voxel));
    const demo::Waves waves({0.1f, 0.25f});
    const auto ground = waves.shape();
    for (int i = 0; i < 4; ++i) {
        const float y = float(random(-1, 1));
        CAPTURE(seed, i, y);
        // at 60 degrees, with 9 J
        Slider slider(*ground, ball, {-5, y, 0.75f}, {2, 0, -3.5f});
        const WorldExtensions extensions(slider.world.dynamics);
        const double before = slider.energy();
        slider.run(0.5f, 240);
        CHECK(slider.energy() < before - 5);
    }
}

TEST_CASE("Smooth ground changes no bit of bodies on flat triangles and of bodies at rest") {
    const unsigned seed = test::seed();
    Random random(seed);
    Shape block(exactBox({0.3f, 0.3f, 0.15f}, voxel));
    const demo::Waves flat({0, 0.25f}), waves({0.1f, 0.25f});
    const auto floor = flat.shape(), rough = waves.shape();
    for (int i = 0; i < 4; ++i) {
        const bool isFlat = i % 2;
        const float x = float(random(-3, -2)), y = float(random(-1, 1)), height = float(random(0.16, 0.3));
        CAPTURE(seed, i, isFlat, x, y, height);
        const auto end = [&](bool smoothGround) {
            const btVector3 velocity = isFlat ? btVector3(2, 0, 0) : btVector3(0, 0, 0);
            Slider slider(isFlat ? *floor : *rough, block, {x, y, height + (isFlat ? 0 : 0.1f)}, velocity);
            if (!isFlat) {  // comes to rest first
                slider.body->setFriction(2);
                slider.run(2, 240);
            }
            const WorldExtensions extensions(slider.world.dynamics, {.smoothGround = smoothGround});
            slider.run(1, 240);
            return slider.body->getWorldTransform();
        };
        CHECK(end(true) == end(false));
    }
}

TEST_CASE("Several world extensions give energy back once") {
    Shape ball(exactSphere(0.25f, voxel));
    const demo::Waves waves({0.1f, 0.25f});
    const auto ground = waves.shape();
    const auto end = [&](int count) {
        Slider slider(*ground, ball, {-5, 0.3f, 0.35f}, {2, 0, 0});
        std::vector<std::unique_ptr<WorldExtensions>> extensions;
        for (int i = 0; i < count; ++i) extensions.push_back(std::make_unique<WorldExtensions>(slider.world.dynamics));
        slider.run(1, 60);
        if (count > 1) extensions.erase(extensions.begin());  // the next one goes on
        slider.run(1, 60);
        return slider.body->getWorldTransform();
    };
    CHECK(end(3) == end(1));
    CHECK_FALSE(end(1) == end(0));
}

TEST_CASE("An impact takes what momentum and energy say, and no more counts than an edge can cause") {
    const unsigned seed = test::seed();
    Random random(seed);
    for (int i = 0; i < 20; ++i) {
        // a point of unit mass on a plane that rises by an angle, without a bounce
        const float angle = float(random(0.01, 0.3)), speed = float(random(0.5, 4));
        CAPTURE(seed, i, angle, speed);
        const float approach = speed * std::sin(angle), along = speed * std::cos(angle);
        const FacetImpact impact{approach, -approach, 0, along, 1, 0.3f, gravity, 0};
        const double lost = 0.5 * double(approach * approach);
        CHECK(double(impact.loss(angle)) == Approx(lost));
        CHECK(double(impact.loss(0.2f * angle)) < 0.32 * lost);  // 8 * 0.2^2
        CHECK(impact.loss(0) == 0);
    }
}

TEST_CASE("An impact after tipping counts up to the fall over the edge, and not for a body that drops") {
    const unsigned seed = test::seed();
    Random random(seed);
    for (int i = 0; i < 20; ++i) {
        const float angle = float(random(0.05, 0.3)), arm = float(random(0.1, 1));
        const float speed = float(random(0.001, 0.01)) * std::sqrt(gravity * arm);
        CAPTURE(seed, i, angle, arm, speed);
        // a rod whose centre moves on at this speed from the edge that it turns about, in small steps of time
        double x = 0, angularSpeed = 0, turned = 0;
        for (const double step = 1e-4; turned < std::tan(double(angle)); x += double(speed) * step) {
            angularSpeed += step * double(gravity) * x / double(arm * arm);
            turned += step * angularSpeed;
        }
        const float fall = std::sqrt(2 * gravity * float(x) * std::tan(angle));
        const auto shareOf = [&](float before, float turning, float pull) {
            const FacetImpact impact{1, -before, 0, speed, 2, arm, pull, -turning};
            return double(impact.loss(angle) / (0.5f * before));
        };
        CHECK(shareOf(0.9f * fall, 0.9f * fall, gravity) == 1);
        CHECK(shareOf(2 * fall, 2 * fall, gravity) == Approx(0.25).epsilon(0.05));
        CHECK(shareOf(fall, 0, gravity) < 0.05);  // drops without rotation
        CHECK(shareOf(fall, fall, 0) < 0.05);
        CHECK(shareOf(fall, fall, -gravity) < 0.05);  // under a ceiling
    }
}

TEST_CASE("Friction counts for a body that rolls over an edge, and not for one that slides") {
    const FacetFriction rolling{{-0.1f, 0, 0}, {0.03f, 0, 0}, {0.01f, 0, 0}, 2};
    CHECK(double(rolling.loss(0.2f)) == Approx(0.002));  // 0.1 N s at 0.02 m/s
    CHECK(rolling.loss(0.1f) == 0);                      // 0.02 m/s of slip at most
    CHECK(FacetFriction{{-0.1f, 0, 0}, {2, 0, 0}, {1.9f, 0, 0}, 2}.loss(0.3f) == 0);
}

TEST_CASE("The maximum turn of smooth edges is that of two half planes, without sharp edges") {
    const auto roof = [](float angle) {
        const float x = std::cos(angle), z = std::sin(angle);
        return std::vector<Triangle>{{{{0, 0, 0}, {0, 1, 0}, {-1, 0, 0}}}, {{{0, 0, 0}, {x, 0, z}, {0, 1, 0}}}};
    };
    for (const float degrees : {0.1f, 3.f, 12.f, 19.f})
        CHECK(detail::maxSmoothEdgeAngle(roof(glm::radians(degrees))) == Approx(glm::radians(degrees)).epsilon(1e-3));
    CHECK(detail::maxSmoothEdgeAngle(roof(0)) == 0);
    CHECK(detail::maxSmoothEdgeAngle(roof(glm::radians(30.f))) == 0);
    CHECK(detail::maxSmoothEdgeAngle({}) == 0);
}
}  // namespace bilayer::smooth_ground_test
