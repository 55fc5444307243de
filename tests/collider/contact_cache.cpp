// SPDX-License-Identifier: Apache-2.0
// The cache of previous steps changes only the speed of the search, never the contacts.
#include "collider/contact/reduction/contact_cache.h"

#include <catch2/catch.hpp>
#include <cstring>
#include <glm/geometric.hpp>

#include <bilayer/collider/collider.h>
#include <bilayer/collider/contact.h>
#include <bilayer/sdf/build.h>
#include "demos/shared/shapes.h"
#include "tests/support/contacts.h"
#include "tests/support/random_pose.h"
#include "tests/support/support.h"

namespace bilayer::contact_cache_test {
using namespace bilayer::detail;
using test::Random;

namespace {

constexpr float h = 0.02f;

const Collider& knot() {
    static const Collider collider = [] {
        const Mesh mesh = shapes::torusKnot(2, 3, 0.3f, 0.09f, 150, 16);
        BuildOptions options{.voxelSize = h};
        options.interiorWidthVoxels = 6;
        return Collider(mesh, build(mesh, options));
    }();
    return collider;
}

const Collider& brick() {
    static const Collider collider = [] {
        const Mesh mesh = shapes::box({0.3f, 0.2f, 0.1f});
        return Collider(mesh, build(mesh, {.voxelSize = 1.3f * h, .method = Method::doubleLayer}));
    }();
    return collider;
}

bool sameBytes(const std::vector<Contact>& a, const std::vector<Contact>& b) {
    return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(Contact)) == 0;
}

// A step of a random walk: translation and rotation up to `size`.
void stroll(Pose& pose, Random& random, float size) {
    pose.position += 0.7f * random.point(double(size));
    pose.rotation = glm::normalize(glm::angleAxis(0.7f * size, random.direction()) * pose.rotation);
}

}  // namespace

TEST_CASE("contacts are the same with what was kept of the steps before, however bodies move") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    std::size_t found = 0;
    long tested = 0, testedAnew = 0;
    for (int walk = 0; walk < 60; ++walk) {
        Placed a{walk % 2 ? knot() : brick(), randomPose(random, 0.45), walk % 3 ? 1.f : 1.7f},
            b{walk % 4 < 2 ? knot() : brick(), randomPose(random, 0.45), walk % 5 ? 1.f : 0.6f};
        const ContactOptions options{.margin = h * float(walk % 4) / 2};
        ContactCache near;
        for (int step = 0; step < 40; ++step) {
            // at rest, slow, fast, and from rest to fast
            const float size = h * (step % 10 < 3 ? 0.f : step % 10 < 8 ? 0.02f : step % 10 == 8 ? 0.3f : 2.f);
            stroll(a.pose, random, size);
            stroll(b.pose, random, size);
            std::vector<Contact> with, without;
            const ContactReport seen = collide(a, b, options, with, &near), anew = collide(a, b, options, without);
            REQUIRE(sameBytes(with, without));
            REQUIRE(seen.beyondBand == anew.beyondBand);
            found += with.size();
            tested += seen.pointsTested;
            testedAnew += anew.pointsTested;
        }
    }
    REQUIRE(found > 1000);
    CHECK(tested != testedAnew);
}

TEST_CASE("bodies that rest next to each other cost little, those that touch little more than their contacts") {
    const Placed a{knot()};
    const auto testedAtRest = [&](const Placed& b, std::vector<Contact>& contacts) {
        ContactCache near;
        ContactReport report;
        // the first step has no velocities, the second creates the list
        for (int i = 0; i < 3; ++i) {
            contacts.clear();
            report = collide(a, b, test::unfiltered(h), contacts, &near);
        }
        return report.pointsTested;
    };
    const auto testedAnew = [&](const Placed& b) {
        std::vector<Contact> contacts;
        return collide(a, b, test::unfiltered(h), contacts).pointsTested;
    };
    std::vector<Contact> contacts;
    const Placed apart{brick(), {{-0.2f, 0, 0.375f}}}, touching{brick(), {{-0.2f, 0, 0.305f}}};
    const std::uint32_t apartAtRest = testedAtRest(apart, contacts);
    CHECK(contacts.empty());
    CHECK(apartAtRest < testedAnew(apart) / 4);
    const std::uint32_t touchingAtRest = testedAtRest(touching, contacts);
    CHECK(contacts.size() > 20);
    CHECK(touchingAtRest < 4 * contacts.size());
    CHECK(touchingAtRest < testedAnew(touching) / 2);
}

TEST_CASE("what was kept of other bodies, or for another margin, is not used") {
    ContactCache near;
    const Placed a{knot()};
    for (const Placed& b : {Placed{brick(), {{0, 0, 0.2f}}}, Placed{knot(), {{0, 0, 0.2f}}}, Placed{brick()}})
        for (const float margin : {0.f, h, 2 * h})
            for (int i = 0; i < 3; ++i) {
                std::vector<Contact> with, without;
                collide(a, b, {.margin = margin}, with, &near);
                collide(a, b, {.margin = margin}, without);
                REQUIRE(sameBytes(with, without));
            }
}
}  // namespace bilayer::contact_cache_test
