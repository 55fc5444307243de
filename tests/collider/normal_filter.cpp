// SPDX-License-Identifier: Apache-2.0
// Which contacts the filter by normals removes.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/constants.hpp>
#include <set>

#include <bilayer/collider/collider.h>
#include <bilayer/collider/contact.h>
#include <bilayer/sdf/build.h>
#include "collider/contact/body/collider_data.h"
#include "collider/contact/search/normal_filter.h"
#include "demos/shared/shapes.h"
#include "sdf/base/access.h"
#include "tests/collider/touching_bodies.h"
#include "tests/support/random.h"
#include "tests/support/support.h"

namespace bilayer::normal_filter_test {
using namespace bilayer::detail;
using namespace bilayer::test;

namespace {

// The feature of a contact: a surface point, or a place on a sharp edge between two of them.
SurfacePoint pointOf(const Collider& collider, std::uint32_t feature) {
    const auto points = dataOf(collider).points().points();
    if (feature < points.size()) return points[feature];
    const SharpEdge& edge = dataOf(collider).edges().edges()[feature - points.size()];
    const SurfacePoint &from = points[edge.from], &to = points[edge.to];
    return {0.5f * (from.position + to.position), glm::normalize(from.normal + to.normal), true};
}

}  // namespace

TEST_CASE("contacts with normals along the surface of their point are filtered out") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    std::size_t all = 0, kept = 0, back = 0, oblique = 0;
    const float apart = GENERATE(-2.f, 0.9f);  // minimum normal cosine of face points that are not yet in contact
    for (const auto& [a, b] : touchingPairs(random)) {
        std::vector<Contact> expected, found;
        const auto opposes = [&, &a = a, &b = b](const Contact& contact) {
            const bool ofB = contact.feature & featureOfB;
            const SurfacePoint point = pointOf((ofB ? b : a).collider, contact.feature & ~featureOfB);
            const float cosine = glm::dot((ofB ? b : a).pose.rotation * point.normal, contact.normal);
            const bool isSeparated = contact.distance > -minFaceDepthVoxels * h && !point.isSharp;
            const float least = isSeparated ? std::max(apart, 0.3f) : 0.3f;
            return (ofB ? cosine : -cosine) >= least;
        };
        std::set<std::uint32_t> sunk;  // convex vertices that may be pushed back along their entry path
        for (const Contact& contact : contactsOf(a, b, h)) {
            const bool ofB = contact.feature & featureOfB;
            const SurfacePoint point = pointOf((ofB ? b : a).collider, contact.feature & ~featureOfB);
            if (opposes(contact)) expected.push_back(contact);
            if (!opposes(contact) && point.isSharp && contact.distance <= 0) sunk.insert(contact.feature);
            ++all;
        }
        collide(a, b, {.margin = h, .minNormalCosineApart = apart, .keepsObliqueEdges = true}, found);
        for (const Contact& contact : found) REQUIRE(opposes(contact));
        back += std::erase_if(found, [&](const Contact& contact) { return sunk.contains(contact.feature); });
        REQUIRE(found.size() == expected.size());
        for (std::size_t i = 0; i < found.size(); ++i) REQUIRE(found[i].feature == expected[i].feature);
        kept += found.size();

        std::vector<Contact> straight;
        collide(a, b, {.margin = h, .minNormalCosineApart = apart}, straight);
        std::set<std::uint32_t> left;
        for (const Contact& contact : straight) left.insert(contact.feature);
        for (const Contact& contact : found) {
            if (left.contains(contact.feature)) continue;
            const bool ofB = contact.feature & featureOfB;
            const SurfacePoint point = pointOf((ofB ? b : a).collider, contact.feature & ~featureOfB);
            REQUIRE(contact.distance > -minFaceDepthVoxels * h);
            REQUIRE_FALSE(point.isSharp);
            REQUIRE(std::abs(glm::dot((ofB ? b : a).pose.rotation * point.normal, contact.normal)) < 0.99997f);
            ++oblique;
        }
    }
    CHECK(oblique < kept);
    REQUIRE(kept > 0);
    REQUIRE(kept + back < all);
}

TEST_CASE("convex vertices in contact are pushed apart along their entry direction") {
    const Mesh cone = shapes::cone(0.2f, 0.8f, 4);
    const auto tip = std::make_shared<Collider>(cone, build(cone, {.voxelSize = 0.04f}),
                                                ColliderOptions{.accuracy = ContactAccuracy::exact});
    for (float depth = 0.01f; depth < 0.035f; depth += 0.005f) {
        std::vector<Contact> found;
        const Pose above{{0, 0, 0.8f - depth}, glm::angleAxis(glm::pi<float>(), glm::vec3(1, 0, 0))};
        collide(*tip, above, *tip, {}, {.minNormalCosine = 0.3f}, found);
        CAPTURE(depth);
        REQUIRE(found.size() == 2);
        for (const Contact& contact : found) {
            CHECK(contact.normal.z > 0.999f);
            CHECK(contact.distance == Approx(-depth).margin(1e-4));
        }
    }
}

TEST_CASE("a face point that touches an edge makes no oblique contact") {
    const unsigned seed = test::seed();
    const float scale = GENERATE(1.f, 100.f);
    CAPTURE(seed, scale);
    Random random(seed);
    const Collider ground(shapes::box({1, 1, 0.1f}), levelSetOf(boxSolid({1, 1, 0.1}), h));
    const auto points = dataOf(ground).points().points();
    int tested = 0;
    for (int i = 0; i < 10000; ++i) {
        const SurfacePoint& point = points[std::size_t(random(0, 1) * double(points.size() - 1))];
        if (point.isSharp || point.normal.z < 0.99f || glm::length(point.position) > 0.3f) continue;
        // the brick stands on the ground, and its lower edge along y passes over the point
        const glm::quat rotation = glm::angleAxis(float(random(0, 2 * glm::pi<double>())), glm::vec3(0, 0, 1));
        const float depth = random(0, 1) < 0.5 ? 0 : std::pow(10.f, -float(random(4, 8)));
        const glm::vec3 onEdge(0.3f + depth * random(-2, 2), random(-0.1, 0.1), -0.1f);
        const Pose pose{scale * (point.position - rotation * onEdge - glm::vec3(0, 0, depth)), rotation};
        const Placed above{brick(), pose, scale}, below{ground, {}, scale};
        for (const bool swapped : {false, true}) {
            CAPTURE(i, depth, swapped);
            std::vector<Contact> found;
            collide(swapped ? below : above, swapped ? above : below, {.margin = 0.1f * scale * h}, found);
            REQUIRE(!found.empty());
            for (const Contact& contact : found) REQUIRE(std::abs(contact.normal.z) > 0.99f);
        }
        ++tested;
    }
    CHECK(tested > 100);
}

}  // namespace bilayer::normal_filter_test
