// SPDX-License-Identifier: Apache-2.0
// Contacts with triangles that Bullet passes one at a time are those of the surface that they form.
#include <BulletCollision/CollisionShapes/btHeightfieldTerrainShape.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <random>
#include <tuple>
#include <vector>

#include <bilayer/collider/contact.h>
#include "collider/contact/open_surface/triangle_contacts.h"
#include "demos/shared/shapes.h"
#include "integration/bullet/detail/contact_shapes.h"
#include "tests/bullet/world.h"
#include "tests/support/contacts.h"
#include "tests/support/support.h"

namespace bilayer::open_surface_test {
using namespace bilayer::detail;
using namespace bilayer::bullet::detail;
using namespace bilayer::test;

namespace {

constexpr float h = 0.05f;             // voxel [m]
constexpr double tolerance = 0.1 * h;  // of depths

// The number of places with contacts. Above an edge, both of its triangles may find the same point.
std::size_t placesOf(std::vector<Contact> contacts) {
    const auto key = [](const Contact& c) { return std::tuple(c.position.x, c.position.y, c.position.z); };
    std::sort(contacts.begin(), contacts.end(), [&](const Contact& a, const Contact& b) { return key(a) < key(b); });
    const auto isSame = [](const Contact& a, const Contact& b) {
        return glm::distance(a.position, b.position) < 1e-5f * h;
    };
    return std::size_t(std::unique(contacts.begin(), contacts.end(), isSame) - contacts.begin());
}

}  // namespace

TEST_CASE("A plane of many triangles makes the contacts of a plane of two") {
    const unsigned start = seed();
    CAPTURE(start);
    const glm::vec3 halfSlab(1.6f, 1.6f, 0.3f);
    const Mesh knot = shapes::torusKnot(2, 3, 0.4f, 0.1f, 200, 16);
    const auto body = deepCollider(knot, h);
    const TriangleShape two(shapes::box(halfSlab)), many(shapes::box(halfSlab, 20));
    std::mt19937 random(start);
    std::uniform_real_distribution<float> part(-1, 1);
    int touching = 0;
    for (int i = 0; i < 100; ++i) {
        const bool overMiddle = i % 2;  // over the middle, else anywhere: over the rim, or next to it
        const float spread = overMiddle ? 0.4f : 2;
        Pose pose{{spread * part(random), spread * part(random), 0},
                  glm::normalize(glm::quat(part(random), part(random), part(random), part(random) + 0.1f))};
        float lowest = 1;
        for (const glm::vec3& point : knot.points) lowest = std::min(lowest, pose.toWorld(point).z);
        pose.position.z = halfSlab.z - lowest + 0.5f * h * part(random);
        const auto collide = [&](const TriangleShape& slab) {
            std::vector<Contact> contacts;
            collideTriangles(bullet::detail::openSurfaceOf(*slab.shape), {}, {}, {*body, pose}, {.margin = h},
                             contacts);
            return contacts;
        };
        const auto few = collide(two), others = collide(many);
        CAPTURE(i, few.size(), others.size());
        if (few.empty() || others.empty()) {
            // near the margin either search may find a slightly nearer place
            for (const auto& found : {few, others})
                if (!found.empty()) REQUIRE(deepest(found).distance > h - tolerance);
            continue;
        }
        ++touching;
        CHECK(deepest(others).distance == Approx(deepest(few).distance).margin(tolerance));
        // each surface piece at the rim is searched separately
        if (!overMiddle) continue;
        const std::size_t fewPlaces = placesOf(few), otherPlaces = placesOf(others);
        CHECK(otherPlaces <= fewPlaces + fewPlaces / 8);
        CHECK(otherPlaces >= fewPlaces - fewPlaces / 8);
    }
    CHECK(touching > 40);
}

TEST_CASE("A corner has the same depth below triangles as below their plane, in any orientation") {
    const unsigned start = seed();
    const ContactAccuracy accuracy =
        GENERATE(ContactAccuracy::samples, ContactAccuracy::exactNearFeatures, ContactAccuracy::exact);
    const bool asTerrain = GENERATE(false, true);
    const float depth = h * GENERATE(-0.5f, 0.05f, 0.2f, 0.5f);
    CAPTURE(start, nameOf(accuracy), asTerrain, depth / h);
    std::mt19937 random(start);
    std::normal_distribution<float> normal;
    const glm::vec3 half(0.5f, 0.4f, 0.3f);
    const auto box = deepCollider(shapes::box(half, 3), h, accuracy);
    const float heights[4] = {};
    btHeightfieldTerrainShape terrain(2, 2, heights, 1, -1, 1, 2, PHY_FLOAT, false);
    terrain.setLocalScaling({6, 6, 1});
    btTriangleMesh triangles;
    triangles.addTriangle({-3, -3, 0}, {3, -3, 0}, {3, 3, 0});
    triangles.addTriangle({-3, -3, 0}, {3, 3, 0}, {-3, 3, 0});
    const btBvhTriangleMeshShape mesh(&triangles, true);
    const btConcaveShape& ground = asTerrain ? static_cast<const btConcaveShape&>(terrain) : mesh;
    for (int run = 0; run < 50; ++run) {
        Pose pose{{0.1f, 0.2f, 0},
                  glm::normalize(glm::quat(normal(random), normal(random), normal(random), normal(random)))};
        float lowest = 0;
        for (int i = 0; i < 8; ++i)
            lowest = std::min(lowest,
                              (pose.rotation * (half * glm::vec3(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1))).z);
        pose.position.z = -lowest - depth;
        std::vector<Contact> contacts;
        collideTriangles(bullet::detail::openSurfaceOf(ground), {}, {}, {*box, pose}, {.margin = h}, contacts);
        float deepest = h;
        glm::vec3 direction(0);
        for (const Contact& contact : contacts)
            if (contact.distance < deepest) deepest = contact.distance, direction = contact.normal;
        CAPTURE(run, deepest / h, direction.z);
        CHECK(deepest == Approx(-depth).margin(0.02 * h));
        CHECK(direction.z < -0.99f);
    }
}

TEST_CASE("A vertex below a crease of triangles has the depths of both faces") {
    const unsigned start = seed();
    const ContactAccuracy accuracy =
        GENERATE(ContactAccuracy::samples, ContactAccuracy::exactNearFeatures, ContactAccuracy::exact);
    const float cell = GENERATE(0.7f, 20.f);  // [voxels]
    CAPTURE(start, nameOf(accuracy), cell);
    std::mt19937 random(start);
    std::uniform_real_distribution<float> any(-1, 1);
    const float height = 1, slope = 0.6f;
    const auto cone = deepCollider(shapes::cone(0.3f, height, 12), h, accuracy);
    const TriangleShape groove(grooveOf(slope, cell * h, cell > 1 ? 2 : 20));
    const glm::vec3 left = glm::normalize(glm::vec3(slope, 0, 1)), right = glm::normalize(glm::vec3(-slope, 0, 1));
    for (int run = 0; run < 50; ++run) {
        const float below = (0.5f + 0.4f * any(random)) * h;
        const glm::vec3 tip(0.9f * slope * below * any(random), 3 * h * any(random), -below);
        const glm::vec3 axis = glm::normalize(glm::vec3(0.3f * any(random), 0.3f * any(random), -1));
        const glm::quat rotation = glm::angleAxis(std::acos(axis.z), glm::normalize(glm::vec3(-axis.y, axis.x, 0)));
        std::vector<Contact> contacts;
        collideTriangles(bullet::detail::openSurfaceOf(*groove.shape), {}, {},
                         {*cone, {tip - 0.5f * height * axis, rotation}}, {.margin = h}, contacts);
        for (const glm::vec3& up : {left, right}) {
            float deepest = h;
            for (const Contact& contact : contacts)
                if (glm::dot(contact.normal, up) < -0.99f) deepest = std::min(deepest, contact.distance);
            CAPTURE(run, tip.x / h, tip.z / h, up.x, deepest / h);
            CHECK(deepest == Approx(glm::dot(up, tip)).margin(0.03f * h));
        }
    }
}
}  // namespace bilayer::open_surface_test
