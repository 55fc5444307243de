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
#include "collider/contact/collider_data.h"
#include "demos/shared/shapes.h"
#include "tests/support/random.h"
#include "tests/support/support.h"
#include "touching_bodies.h"

namespace bilayer::normal_filter_test {
using namespace bilayer::detail;
using namespace bilayer::test;

namespace {

// The feature of a contact: a surface point, or a place on a sharp edge between two of them.
SurfacePoint pointOf(const Collider& collider, std::uint32_t feature) {
    const auto points = collider.data().points().points();
    if (feature < points.size()) return points[feature];
    const SharpEdge& edge = collider.data().edges().edges()[feature - points.size()];
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
            const float least = contact.distance > 0 && !point.isSharp ? std::max(apart, 0.3f) : 0.3f;
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
            REQUIRE(contact.distance > 0);
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
}  // namespace bilayer::normal_filter_test
