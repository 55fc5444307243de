// SPDX-License-Identifier: Apache-2.0
// Multispheres: the distance from their hull, and the depth of balls in a groove.
#include <BulletCollision/CollisionShapes/btMultiSphereShape.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <random>

#include <bilayer/collider/contact.h>
#include "collider/contact/search/convex_contacts.h"
#include "collider/contact/shapes/multisphere.h"
#include "demos/shared/exact_distance.h"
#include "integration/bullet/detail/contact_shapes.h"
#include "integration/bullet/detail/convert.h"
#include "tests/bullet/world.h"
#include "tests/support/contacts.h"
#include "tests/support/support.h"

namespace bilayer::multisphere_test {
using namespace bilayer::detail;
using namespace bilayer::bullet::detail;
using namespace bilayer::test;

namespace {

constexpr float h = 0.05f;  // voxel [m]

}  // namespace

TEST_CASE("The distance from a multisphere is that of its support function, outside and inside") {
    const unsigned start = seed();
    CAPTURE(start);
    std::mt19937 random(start);
    std::uniform_real_distribution<float> part(-1, 1);
    const auto vector = [&] { return glm::vec3(part(random), part(random), part(random)); };
    for (int run = 0; run < 60; ++run) {
        std::vector<SphereOfHull> balls;
        for (int i = 0; i <= run % 6; ++i) balls.push_back({0.5f * vector(), 0.02f + 0.2f * std::abs(part(random))});
        if (run % 3 == 0)
            for (auto& ball : balls) ball.radius = 0.2f;
        const MultisphereHull hull(balls);
        for (int i = 0; i < 20; ++i) {
            const glm::vec3 point = 1.2f * vector();
            const auto near = hull.nearest(point, 0);
            const auto along = [&](const glm::vec3& v) {
                float least = std::numeric_limits<float>::max();
                for (const auto& ball : balls) least = std::min(least, glm::dot(v, point - ball.centre) - ball.radius);
                return least;
            };
            // hill climbing from many directions
            float best = -std::numeric_limits<float>::max();
            for (int k = 0; k < 40; ++k) {
                glm::vec3 v = glm::normalize(vector());
                float value = along(v);
                for (float step = 0.5f; step > 1e-5f;) {
                    const glm::vec3 next = glm::normalize(v + step * vector());
                    if (const float there = along(next); there > value)
                        v = next, value = there;
                    else
                        step *= 0.93f;
                }
                best = std::max(best, value);
            }
            CAPTURE(run, i, balls.size());
            // no direction gives a greater distance, and the returned one attains it
            CHECK(best < near.distance + 1e-5f);
            CHECK(best > near.distance - 1e-2f);
            CHECK(along(near.normal) == Approx(near.distance).margin(1e-5));
            // the returned ball touches the surface there
            const glm::vec3 foot = point - near.distance * near.normal;
            CHECK(glm::distance(foot, near.core + near.radius * near.normal) < 1e-4f);
        }
    }
}

TEST_CASE("The surface of a multisphere is that of its balls at any margin and scale") {
    const float scale = GENERATE(0.01f, 1.f, 100.f);
    const btVector3 centres[] = {scale * btVector3(-0.3f, -0.2f, 0), scale * btVector3(0.3f, -0.2f, 0),
                                 scale * btVector3(0, 0.3f, 0)};
    const float radii[] = {scale * 0.25f, scale * 0.2f, scale * 0.15f};
    const btMultiSphereShape spheres(centres, radii, 3);
    const Convex convex = convexOf(spheres);
    for (int i = 0; i < 3; ++i) {
        const glm::vec3 above = bullet::detail::toGlm(centres[i]) + glm::vec3(0, 0, scale);
        CHECK(convex.nearest(above, scale).distance <= Approx(scale - radii[i]));
    }
    const glm::vec3 nextTo = scale * glm::vec3(-1, -0.2f, 0);
    CHECK(convex.nearest(nextTo, scale).distance == Approx(0.45f * scale));
    CHECK(convex.nearest(nextTo, scale).normal.x == Approx(-1));
}

TEST_CASE("Balls rest in a groove at the depth of its two faces") {
    // a right-angled groove along x, its bottom off the voxel centres
    const glm::vec3 bottom(0, 0.37f * h, 0.61f * h);
    const glm::vec2 section[] = {{-0.3f, -0.2f}, {0.3f, -0.2f}, {0.3f, 0.3f}, {0, 0}, {-0.3f, 0.3f}};
    Mesh mesh;
    for (const float x : {-0.5f, 0.5f})
        for (const glm::vec2& p : section) mesh.points.push_back(bottom + glm::vec3(x, p.x, p.y));
    for (unsigned i = 0; i < 5; ++i) {
        const unsigned next = (i + 1) % 5;
        mesh.triangles.push_back({i, next, 5 + next});
        mesh.triangles.push_back({i, 5 + next, 5 + i});
    }
    for (const glm::uvec3& t : {glm::uvec3(3, 4, 0), glm::uvec3(3, 0, 1), glm::uvec3(3, 1, 2)}) {
        mesh.triangles.push_back({t.x, t.z, t.y});
        mesh.triangles.push_back(t + 5u);
    }
    const auto deepestWith = [&](ContactAccuracy accuracy, float radius) {
        const auto groove = deepCollider(mesh, h, accuracy);
        btSphereShape ball(radius);
        std::vector<Contact> contacts;
        const Pose lying{bottom + glm::vec3(0, 0, std::sqrt(2.f) * radius)};
        collideConvex(convexOf(ball), lying, {}, {*groove, {}}, {.margin = h}, contacts);
        return deepest(contacts).distance;
    };
    for (const float voxels : {0.9f, 1.5f, 2.f}) {
        CAPTURE(voxels);
        CHECK(std::abs(deepestWith(ContactAccuracy::exactNearFeatures, voxels * h)) < 0.01f * h);
        CHECK(std::abs(deepestWith(ContactAccuracy::exact, voxels * h)) < 0.01f * h);
        CHECK(std::abs(deepestWith(ContactAccuracy::samples, voxels * h)) > 0.1f * h);
    }
}
}  // namespace bilayer::multisphere_test
