// SPDX-License-Identifier: Apache-2.0
// What a collider is made of: fields, masses, flipped and open meshes; and arguments that it rejects.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/constants.hpp>
#include <limits>
#include <stdexcept>

#include <bilayer/collider/collider.h>
#include <bilayer/collider/contact.h>
#include <bilayer/collider/mass.h>
#include <bilayer/sdf/build.h>
#include "collider/contact/body/collider_data.h"
#include "demos/shared/shapes.h"
#include "sdf/base/access.h"
#include "tests/support/analytic.h"
#include "tests/support/contacts.h"
#include "tests/support/random.h"
#include "tests/support/support.h"

namespace bilayer::collider_test {
using namespace bilayer::detail;
using namespace bilayer::test;

namespace {

constexpr float h = 0.02f;

}  // namespace

TEST_CASE("margins that are not finite, or too large for the body, are rejected") {
    const Mesh mesh = shapes::box({1, 1, 1});
    const LevelSet field = build(mesh, {.voxelSize = 0.25f});
    for (const float margin : {std::numeric_limits<float>::quiet_NaN(), 251.f, 1e30f})
        CHECK_THROWS_AS(Collider(mesh, field, {.margin = margin}), std::invalid_argument);
    CHECK(Collider(mesh, field, {.margin = 249}).margin() == 249);
}

TEST_CASE("a body of a mesh that faces the wrong way is the body of the right one") {
    const ContactAccuracy accuracy =
        GENERATE(ContactAccuracy::samples, ContactAccuracy::exactNearFeatures, ContactAccuracy::exact);
    const bool isShuffled = GENERATE(false, true);
    CAPTURE(nameOf(accuracy), isShuffled);
    const Mesh mesh = shapes::torus(0.35f, 0.13f);
    Mesh wrong = shapes::flipped(mesh);
    Random random(test::seed());
    if (isShuffled)
        for (glm::uvec3& t : wrong.triangles)
            if (random(0, 1) < 0.5) std::swap(t.y, t.z);
    const ColliderOptions options{.accuracy = accuracy};
    const Collider right(mesh, build(mesh, {.voxelSize = h}), options),
        repaired(wrong, build(wrong, {.voxelSize = h}), options);
    CHECK(repaired.mass().volume == Approx(right.mass().volume));
    CHECK(dataOf(repaired).edges().edges().empty());
    REQUIRE(dataOf(repaired).points().points().size() > 100);
    for (const SurfacePoint& point : dataOf(repaired).points().points())
        REQUIRE(glm::dot(point.normal, right.field().sample(point.position).gradient) > 0.5f);
    // crossed: inward normals would remove the points
    const Pose across{{0.35f, 0, 0}, glm::angleAxis(glm::half_pi<float>(), glm::vec3(1, 0, 0))};
    const auto found = [&](const Collider& body) {
        std::vector<Contact> contacts;
        collide({body, {{0.1f, 0, 0}}}, {body, across}, {.margin = h, .minNormalCosine = 0.3f}, contacts);
        return contacts;
    };
    const auto expected = found(right), contacts = found(repaired);
    REQUIRE(expected.size() > 20);
    CHECK(contacts.size() > 0.8 * double(expected.size()));
    CHECK(minDistance(contacts) == Approx(minDistance(expected)).margin(0.1 * h));
}

TEST_CASE("a body whose mesh is open or one-sided has the mass of its field, and can be stored with it") {
    Mesh open = shapes::box({0.3f, 0.2f, 0.1f}, 8);
    open.triangles.resize(open.triangles.size() - 40);
    Mesh strip;  // a Moebius strip
    constexpr unsigned around = 96;
    for (unsigned i = 0; i < around; ++i) {
        const float angle = 2 * glm::pi<float>() * float(i) / around;
        const glm::vec3 out(std::cos(angle), std::sin(angle), 0);
        const glm::vec3 across = std::cos(angle / 2) * out + std::sin(angle / 2) * glm::vec3(0, 0, 1);
        for (const float side : {-0.1f, 0.1f}) strip.points.push_back(0.4f * out + side * across);
        const unsigned a = 2 * i, b = a + 1, c = (a + 2) % (2 * around), d = (a + 3) % (2 * around);
        const bool isLast = i + 1 == around;
        strip.triangles.emplace_back(a, isLast ? d : c, b);
        strip.triangles.emplace_back(b, isLast ? d : c, isLast ? c : d);
    }
    for (const Mesh& mesh : {open, strip}) {
        const LevelSet field = build(mesh, {.voxelSize = h});
        const Collider body(mesh, field);
        CAPTURE(mesh.triangles.size(), field.sign());
        if (dataOf(body).body.mass) CHECK(body.mass().volume == massProperties(field).volume);
        const Collider kept(withBody(field, dataOf(body).body));
        CHECK(dataOf(kept).points().points().size() == dataOf(body).points().points().size());
    }
    const Collider box(open, build(open, {.voxelSize = h}));
    CHECK(box.mass().volume == Approx(0.6 * 0.4 * 0.2).epsilon(0.05));
}

TEST_CASE("a collider rejects the level set of another mesh") {
    const Mesh mesh = shapes::box({0.3f, 0.2f, 0.1f});
    REQUIRE_THROWS_AS(Collider(mesh, build(shapes::sphere(0.4f, 4), {.voxelSize = h})), std::invalid_argument);
    Mesh moved = mesh;
    moved.origin.x = 1;
    const LevelSet levelSet = build(mesh, {.voxelSize = h});
    REQUIRE_THROWS_WITH(Collider(moved, levelSet), Catch::Contains("another origin"));
    REQUIRE_THROWS_WITH(Field(levelSet, moved), Catch::Contains("another origin"));
}

TEST_CASE("a collider rejects an empty mesh") {
    REQUIRE_THROWS_AS(Collider(Mesh{}, levelSetOf(sphereSolid(0.4), h)), std::invalid_argument);
}
}  // namespace bilayer::collider_test
