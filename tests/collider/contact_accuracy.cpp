// SPDX-License-Identifier: Apache-2.0
// How far contacts are from those of the triangles, for each accuracy.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/constants.hpp>

#include <bilayer/collider/collider.h>
#include <bilayer/collider/contact.h>
#include <bilayer/sdf/build.h>
#include "collider/contact/body/collider_data.h"
#include "demos/shared/shapes.h"
#include "demos/shared/threads.h"
#include "sdf/base/access.h"
#include "tests/collider/touching_bodies.h"
#include "tests/support/analytic.h"
#include "tests/support/contacts.h"
#include "tests/support/random.h"
#include "tests/support/support.h"
#include "tests/support/truth.h"

namespace bilayer::contact_accuracy_test {
using namespace bilayer::detail;
using namespace bilayer::test;

TEST_CASE("beyond the band, edges have the distance of the triangles' edges, and normals across both") {
    const ContactAccuracy accuracy =
        GENERATE(ContactAccuracy::samples, ContactAccuracy::exactNearFeatures, ContactAccuracy::exact);
    const float gap = GENERATE(0.03f, 0.05f, 0.06f, 0.1f, 0.25f);
    const float scale = GENERATE(1.f, 10.f);
    const bool crosses = GENERATE(false, true);
    CAPTURE(nameOf(accuracy), gap, scale, crosses);
    // edge descent starts from points in contact
    const float beyond = crosses ? 0.02f : 0.001f;
    const Mesh mesh = shapes::box({0.3f, 0.2f, 0.1f});
    const Collider brick(mesh, build(mesh, {.voxelSize = h}), {.accuracy = accuracy});
    const float half = std::sqrt(0.5f), sideways = half * gap, quarter = glm::pi<float>() / 4;
    // an edge next to and above another one, or above and across it
    Pose upper{{0.6f + sideways, 0.01f, 0.2f + sideways}}, lower;
    glm::vec3 across(half, 0, half);
    if (crosses) {
        upper = {{0, 0, half * 0.3f + half * 0.4f + gap}, glm::angleAxis(quarter, glm::vec3(1, 0, 0))};
        lower = {{}, glm::angleAxis(quarter, glm::vec3(0, 1, 0))};
        across = {0, 0, 1};
    }
    upper.position *= scale;
    std::vector<Contact> found;
    const ContactOptions options{.margin = scale * (gap + beyond), .exact = true};
    collide(Placed{brick, upper, scale}, Placed{brick, lower, scale}, options, found);
    const Contact& nearest = deepest(found);
    CAPTURE(nearest.distance / scale, nearest.normal.x, nearest.normal.y, nearest.normal.z);
    CHECK(nearest.distance == Approx(scale * gap).margin(1e-3 * scale * h));
    CHECK(glm::dot(nearest.normal, across) > 0.9999f);
}

TEST_CASE("a body between two walls has contacts at any distance, with margins inside and beyond the band") {
    const Mesh wall = shapes::box({0.1f, 0.5f, 0.5f}), small = shapes::box({0.1f, 0.1f, 0.1f});
    const Mesh walls = shapes::join({shapes::moved(wall, {-0.6f, 0, 0}), shapes::moved(wall, {0.6f, 0, 0})});
    const Collider two(walls, build(walls, {.voxelSize = h}), {.accuracy = ContactAccuracy::exact}),
        body(small, build(small, {.voxelSize = h}));
    for (float gap = 0.02f; gap < 0.2f; gap += 0.003f) {
        CAPTURE(gap);
        std::vector<Contact> found;
        const ContactOptions options{.margin = gap + 0.001f, .exact = true};
        collide(body, {{-0.4f + gap, 0.013f, 0.007f}}, two, {}, options, found);
        const Contact& nearest = deepest(found);
        CHECK(nearest.distance == Approx(gap).margin(1e-4));
        CHECK(nearest.normal.x > 0.999f);
    }
}

TEST_CASE("bodies whose fields the double layer method made touch within its error") {
    const Mesh mesh = shapes::box({0.3f, 0.2f, 0.1f});
    const Collider box(mesh, built(mesh, h));
    for (const float gap : {-1.f * h, 0.5f * h}) {
        const auto contacts = contactsOf({box, {{0.05f, 0.03f, 0.2f + gap}}}, {box}, h);
        REQUIRE_FALSE(contacts.empty());
        REQUIRE(minDistance(contacts) == Approx(gap).margin(0.5 * h));
        for (const Contact& contact : contacts)
            if (glm::all(glm::lessThan(glm::abs(contact.position), glm::vec3(0.2f, 0.1f, 1))))
                REQUIRE(contact.normal.z > 0.95f);
    }
}

TEST_CASE("exact contacts lie on the triangles, on edges and in grooves of half a voxel's play") {
    const shapes::Thread thread{};
    const Mesh meshes[] = {shapes::nut({.thread = thread, .segments = 48}),
                           shapes::bolt({.thread = thread, .length = 40e-3f, .segments = 48})};
    const Truth truths[] = {Truth(meshes[0]), Truth(meshes[1])};
    constexpr float voxel = 0.4e-3f;
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    // errors of distances, and distances of contacts from the surface [voxels]
    struct Errors {
        double distance = 0, foot = 0;
    };
    const auto errors = [&](ContactAccuracy accuracy, const Pose& pose) {
        std::vector<Collider> parts;
        for (const Mesh& mesh : meshes)
            parts.emplace_back(mesh, build(mesh, {.voxelSize = voxel}), ColliderOptions{.accuracy = accuracy});
        const Pose poses[] = {pose, {}};
        std::vector<Contact> contacts;
        collide(parts[0], pose, parts[1], {}, {.margin = voxel / 2}, contacts);
        CHECK(contacts.size() > 500);
        Errors worst;
        for (const Contact& contact : contacts) {
            const int other = contact.feature & featureOfB ? 0 : 1;
            const auto points = dataOf(parts[std::size_t(1 - other)]).points().points();
            const std::uint32_t index = contact.feature & ~featureOfB;
            // for crossing edges the distance is not that of a point
            if (index >= points.size()) continue;
            const SurfacePoint& point = points[index];
            const glm::vec3 from = poses[other].toBody(poses[1 - other].toWorld(point.position));
            const glm::vec3 outward =
                glm::conjugate(poses[other].rotation) * (other == 0 ? -contact.normal : contact.normal);
            worst.distance = std::max(
                worst.distance, std::abs(double(contact.distance) - truths[other].signedDistance(glm::dvec3(from))));
            worst.foot = std::max(
                worst.foot, truths[other].distance(glm::dvec3(from) - double(contact.distance) * glm::dvec3(outward)));
        }
        return Errors{worst.distance / voxel, worst.foot / voxel};
    };
    for (int i = 0; i < 3; ++i) {
        Pose pose = shapes::onThread(thread, float(random(16e-3, 24e-3)));
        pose.position += random.point(50e-6f);
        const Errors exact = errors(ContactAccuracy::exact, pose),
                     mixed = errors(ContactAccuracy::exactNearFeatures, pose),
                     sampled = errors(ContactAccuracy::samples, pose);
        CHECK(exact.distance < 1e-4);
        CHECK(exact.foot < 0.02);  // near an edge its own normal is used
        CHECK(mixed.distance < 0.2);
        CHECK(mixed.foot < 0.2);
        CHECK(sampled.distance > 0.02);
        CHECK(sampled.foot > 0.05);
    }
}
}  // namespace bilayer::contact_accuracy_test
