// SPDX-License-Identifier: Apache-2.0
// Contacts between two bodies.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <map>

#include <bilayer/collider/contact.h>
#include <bilayer/sdf/build.h>
#include "collider/contact/body/collider_data.h"
#include "demos/shared/shapes.h"
#include "sdf/base/access.h"
#include "tests/collider/touching_bodies.h"
#include "tests/support/contacts.h"
#include "tests/support/random.h"
#include "tests/support/support.h"

namespace bilayer::collide_test {
using namespace bilayer::detail;
using namespace bilayer::test;

namespace {

Pose compose(const Pose& a, const Pose& b) {
    return {a.toWorld(b.position), a.rotation * b.rotation};
}

// How far the triangles of the ball's mesh lie inside the ball, and their max angle to its surface.
struct Facets {
    float depth = 0, angle = 0;

    Facets() {
        const Mesh mesh = shapes::sphere(0.4f, 4);
        for (const glm::uvec3& t : mesh.triangles) {
            const glm::vec3 a = mesh.points[t.x];
            const glm::vec3 normal = glm::normalize(glm::cross(mesh.points[t.y] - a, mesh.points[t.z] - a));
            depth = std::max(depth, 0.4f - glm::dot(normal, a));
            for (int i = 0; i < 3; ++i)
                angle = std::max(angle, std::acos(glm::dot(normal, glm::normalize(mesh.points[t[i]]))));
        }
    }
};

}  // namespace

TEST_CASE("the contact of two balls is on the line of their centres") {
    const Facets facets;
    // A distance is a triangle's, or it is interpolated: then it is off by at most h^2 / 8 times the sum of its second
    // derivatives, 2 / R.
    const float interpolated = h * h / (4 * (0.4f - 2 * h)), measured = std::max(facets.depth, interpolated);
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (const float gap : {-1.2f * h, -0.3f * h, 0.f, 0.8f * h, 1.2f * h}) {
        const Pose poseB = randomPose(random, 2);
        const glm::vec3 line = random.direction();
        const Pose poseA{poseB.position + (0.8f + gap) * line, randomPose(random, 1).rotation};
        std::vector<Contact> contacts;
        const ContactReport report = collide(ball(), poseA, ball(), poseB, {.margin = 2 * h}, contacts);
        CAPTURE(gap, contacts.size());
        REQUIRE(contacts.size() > 2);
        REQUIRE(report.beyondBand == 0);
        REQUIRE(report.pointsTested < dataOf(ball()).points().points().size());
        // points are 2 voxels apart, so the nearest may miss the line by 1.25 spacings: 0.05 on a radius of 0.4
        REQUIRE(minDistance(contacts) == Approx(gap).margin(0.0063));
        REQUIRE(minDistance(contacts) >= gap - interpolated);
        for (const Contact& contact : contacts) {
            REQUIRE(glm::length(contact.normal) == Approx(1).margin(1e-5));
            REQUIRE(contact.distance <= 2 * h);
            REQUIRE(glm::distance(contact.position, poseB.position) == Approx(0.4).margin(facets.depth + 1e-6));
            const bool ofB = contact.feature & featureOfB;
            const glm::vec3 centre = ofB ? poseA.position : poseB.position;
            const glm::vec3 point = ofB ? contact.position : contact.position + contact.distance * contact.normal;
            const glm::vec3 expected = glm::normalize(ofB ? centre - point : point - centre);
            // a gradient rotates by h / R within a cell, so its error is at most half of that in either tangent
            // direction of the ball; a normal of the mesh is a triangle's
            REQUIRE(glm::distance(contact.normal, expected) <
                    std::max(std::sqrt(2.f) * 0.5f * h / (0.4f - 2 * h), facets.angle));
            REQUIRE(glm::dot(contact.normal, line) > 0.8f);
            REQUIRE(contact.distance == Approx(glm::distance(point, centre) - 0.4).margin(measured + 1e-6));
        }
    }
}

TEST_CASE("a brick on a slab touches with its corners") {
    for (const float gap : {-1.2f * h, 0.f, 0.7f * h}) {
        const Pose above{{0.03f, -0.02f, 0.2f + gap}};
        const auto contacts = contactsOf({brick(), above}, {slab()}, h);
        int corners = 0;
        for (const Contact& contact : contacts) {
            // beyond the brick's edges, where the slab's points sample it, its field is rounded
            if (contact.feature & featureOfB) {
                REQUIRE(contact.position.z == Approx(0.1).margin(1e-6));
                continue;
            }
            const glm::vec3 point = contact.position + contact.distance * contact.normal;
            REQUIRE(contact.distance == Approx(point.z - 0.1).margin(1e-5));
            REQUIRE(contact.position.z == Approx(0.1).margin(1e-5));
            REQUIRE(contact.normal.z == Approx(1).margin(1e-4));
            const glm::vec3 inBrick = point - above.position;
            corners += std::abs(inBrick.x) > 0.2999f && std::abs(inBrick.y) > 0.1999f && inBrick.z < -0.0999f;
        }
        REQUIRE(corners == 4);
    }
}

TEST_CASE("a corner that points into a slab is the deepest contact") {
    // the brick stands on the corner (-,-,-): its diagonal is vertical
    const glm::vec3 diagonal(0.3f, 0.2f, 0.1f);
    const glm::vec3 axis = glm::normalize(glm::cross(diagonal, glm::vec3(0, 0, 1)));
    const float angle = std::acos(diagonal.z / glm::length(diagonal));
    const float depth = 0.5f * h;
    const Pose pose{{0, 0, 0.1f + glm::length(diagonal) - depth}, glm::angleAxis(angle, axis)};
    const auto contacts = contactsOf({brick(), pose}, {slab()}, 0);
    REQUIRE_FALSE(contacts.empty());
    const auto least = *std::min_element(contacts.begin(), contacts.end(),
                                         [](const Contact& a, const Contact& b) { return a.distance < b.distance; });
    REQUIRE(least.distance == Approx(-depth).margin(1e-5));
    REQUIRE(glm::distance(least.position, {0, 0, 0.1f}) < 1e-5f);
    REQUIRE(glm::distance(least.normal, {0, 0, 1}) < 1e-4f);
    REQUIRE_FALSE(least.feature & featureOfB);
}

TEST_CASE("exchanged bodies have the same contacts with opposite normals") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (const auto& [a, b] : touchingPairs(random)) {
        const auto there = contactsOf(a, b, h), back = contactsOf(b, a, h);
        REQUIRE(there.size() == back.size());
        std::map<std::uint32_t, Contact> byFeature;
        for (const Contact& contact : back) byFeature[contact.feature ^ featureOfB] = contact;
        for (const Contact& contact : there) {
            REQUIRE(byFeature.contains(contact.feature));
            const Contact& other = byFeature[contact.feature];
            REQUIRE(contact.distance == other.distance);
            REQUIRE(glm::distance(contact.normal, -other.normal) < 1e-6f);
            // on the surfaces of both bodies: a distance apart
            const glm::vec3 across = contact.position + contact.distance * contact.normal;
            REQUIRE(glm::distance(across, other.position) < 1e-6f);
        }
    }
}

namespace {

// The point at which a contact was found: on the surface of the body that owns its feature.
glm::vec3 surfacePoint(const Contact& contact) {
    const bool ofB = (contact.feature & featureOfB) != 0;
    return ofB ? contact.position : contact.position + contact.distance * contact.normal;
}

}  // namespace

TEST_CASE("contacts move with the bodies") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (const auto& [a, b] : touchingPairs(random)) {
        const Pose motion = randomPose(random, 1);
        const auto still = contactsOf(a, b, h);
        const auto moved = contactsOf({a.collider, compose(motion, a.pose)}, {b.collider, compose(motion, b.pose)}, h);
        std::map<std::uint32_t, Contact> byFeature;
        for (const Contact& contact : moved) byFeature[contact.feature] = contact;
        for (const Contact& contact : still) {
            if (contact.distance > h - 1e-5f) continue;  // rounding may move it outside the margin
            REQUIRE(byFeature.contains(contact.feature));
            const Contact& other = byFeature[contact.feature];
            REQUIRE(other.distance == Approx(contact.distance).margin(5e-6));
            // the surface point; the normal may jump if rounding moves that point into the next cell of the field
            REQUIRE(glm::distance(surfacePoint(other), motion.toWorld(surfacePoint(contact))) < 1e-5f);
            REQUIRE(glm::dot(other.normal, motion.rotation * contact.normal) > 0.99f);
        }
    }
}

TEST_CASE("contacts of scaled bodies are the contacts scaled") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (const auto& [a, b] : touchingPairs(random)) {
        const float scale = 4;  // a power of two: rounding is unchanged
        const auto small = contactsOf(a, b, h);
        const Placed bigA{a.collider, {scale * a.pose.position, a.pose.rotation}, scale};
        const Placed bigB{b.collider, {scale * b.pose.position, b.pose.rotation}, scale};
        const auto big = contactsOf(bigA, bigB, scale * h);
        REQUIRE(small.size() == big.size());
        for (std::size_t i = 0; i < small.size(); ++i) {
            REQUIRE(big[i].feature == small[i].feature);
            REQUIRE(big[i].distance == Approx(scale * small[i].distance).margin(1e-6));
            REQUIRE(glm::distance(big[i].position, scale * small[i].position) < 1e-5f);
            REQUIRE(glm::distance(big[i].normal, small[i].normal) < 1e-5f);
        }
    }
    // one large, one small: a ball of 0.2 above a ball of 0.8
    const auto contacts = contactsOf({ball(), {{0, 0, 1.005f}}, 0.5f}, {ball(), {}, 2}, h);
    REQUIRE(minDistance(contacts) == Approx(0.005).margin(0.0063));
    for (const Contact& contact : contacts) REQUIRE(glm::length(contact.position) == Approx(0.8).margin(0.04 * h));
}

TEST_CASE("the tree leaves no contact out") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    std::size_t tested = 0, total = 0;
    for (const auto& [a, b] : touchingPairs(random)) {
        ContactReport report;
        const auto contacts = contactsOf(a, b, h, &report);
        std::vector<std::uint32_t> all;
        const auto test = [&](const Placed& body, const Placed& other, std::uint32_t flag) {
            for (std::uint32_t i = 0; i < dataOf(body.collider).points().points().size(); ++i) {
                const glm::vec3 world = body.pose.toWorld(dataOf(body.collider).points().points()[i].position);
                const Sample sample = other.collider.field().sample(other.pose.toBody(world));
                if (sample.inBand && sample.distance < h - 1e-5f) all.push_back(i | flag);
            }
        };
        test(a, b, 0);
        test(b, a, featureOfB);
        std::vector<std::uint32_t> found;
        for (const Contact& contact : contacts) found.push_back(contact.feature);
        REQUIRE(std::is_sorted(found.begin(), found.end()));
        REQUIRE(std::includes(found.begin(), found.end(), all.begin(), all.end()));
        tested += report.pointsTested;
        total += dataOf(a.collider).points().points().size() + dataOf(b.collider).points().points().size();
    }
    REQUIRE(tested < total);  // a ball in a ring may need all of them, the pairs together do not
}

TEST_CASE("separate bodies have no contact and cost almost nothing") {
    ContactReport report;
    REQUIRE(contactsOf({ball(), {{5, 0, 0}}}, {ring()}, h, &report).empty());
    REQUIRE(report.pointsTested == 0);
    REQUIRE(contactsOf({ball(), {{1e30f, 0, 0}}}, {ring()}, h, &report).empty());
    // a small ball in the hole of a ring: their boxes overlap, the bodies do not
    REQUIRE(contactsOf({ball(), {}, 0.3f}, {ring()}, h, &report).empty());
    REQUIRE(report.pointsTested <
            (dataOf(ball()).points().points().size() + dataOf(ring()).points().points().size()) / 4);
    const float nan = std::numeric_limits<float>::quiet_NaN();
    REQUIRE(contactsOf({ball(), {{nan, 0, 0}}}, {ball()}, h, &report).empty());
    REQUIRE(report.beyondBand == 0);
}

TEST_CASE("points too deep for the band are counted") {
    ContactReport report;
    const auto contacts = contactsOf({brick(), {}, 0.5f}, {ball()}, 0, &report);
    REQUIRE(report.beyondBand == dataOf(brick()).points().points().size());
    REQUIRE(contacts.empty());
}

TEST_CASE("existing contacts in the list stay, and repeated queries have equal results") {
    std::vector<Contact> contacts(3);
    collide(ball(), {{0.79f, 0, 0}}, ball(), {}, unfiltered(h), contacts);
    const auto again = contactsOf({ball(), {{0.79f, 0, 0}}}, {ball()}, h);
    REQUIRE(contacts.size() == again.size() + 3);
    for (std::size_t i = 0; i < again.size(); ++i) {
        REQUIRE(contacts[i + 3].feature == again[i].feature);
        REQUIRE(contacts[i + 3].position == again[i].position);
        REQUIRE(contacts[i + 3].normal == again[i].normal);
        REQUIRE(contacts[i + 3].distance == again[i].distance);
    }
}

TEST_CASE("bodies that approach from beyond the band get contacts, at any margin") {
    const float margin = GENERATE(1.f, 2.f, 4.f) * h, gap = GENERATE(0.5f, 1.5f, 2.5f, 3.5f, 6.f) * h;
    const Placed still{slab()}, moving{brick(), {{0, 0, 0.2f + gap}}, 1, {.displacement = {0, 0, -8 * h}}};
    std::vector<Contact> contacts;
    collide(moving, still, {.margin = margin}, contacts);
    CAPTURE(margin / h, gap / h);
    int corners = 0;
    for (const Contact& contact : contacts)
        if (std::abs(contact.position.x) > 0.29f && std::abs(contact.position.y) > 0.19f &&
            contact.distance < gap + 0.5f * h && !(contact.feature & featureOfB)) {
            ++corners;
            CHECK(contact.distance == Approx(gap).margin(0.05 * h));
            CHECK(contact.approach == Approx(8 * h).margin(0.05 * h));
        }
    CHECK(corners >= 4);
}

TEST_CASE("The contacts of a step have the approach of its motion, on the points of either body, or none has") {
    const float margin = 2 * h, radius = glm::length(brick().bounds().size()) / 2;
    for (const float fraction : {0.5f, 3.f}) {
        // the corners of the slab, far from the brick, move farther than the margin in both cases
        const glm::vec3 rotation(fraction * margin / radius, 0, 0);
        const Placed lying{slab()}, tilting{brick(), {{0, 0, 0.2f - 0.1f * h}}, 1, {.rotation = rotation}};
        std::vector<Contact> contacts;
        collide(lying, tilting, {.margin = margin}, contacts);
        int ofSlab = 0, ofBrick = 0;
        for (const Contact& contact : contacts) {
            if (contact.distance > 0) continue;  // the path of a point next to an edge may miss it
            const glm::vec3 moved = glm::cross(rotation, contact.position - tilting.pose.position);
            const float expected = fraction > 1 ? std::max(glm::dot(moved, contact.normal), 0.f) : 0;
            CHECK(contact.approach == Approx(expected).margin(0.05 * h));
            ++(contact.feature & featureOfB ? ofBrick : ofSlab);
        }
        CHECK(ofSlab > 10);
        CHECK(ofBrick > 10);
    }
}

namespace {

// Surface points with a contact closer than the margin by more than `tolerance`, in ascending order.
std::vector<std::uint32_t> pointsInContact(const Placed& a, const Placed& b, const ContactOptions& options,
                                           float tolerance) {
    std::vector<Contact> contacts;
    collide(a, b, options, contacts);
    std::vector<std::uint32_t> points;
    for (const Contact& contact : contacts) {
        const Placed& body = contact.feature & featureOfB ? b : a;
        const bool isPoint = (contact.feature & ~featureOfB) < dataOf(body.collider).points().points().size();
        if (isPoint && contact.distance < options.margin - tolerance) points.push_back(contact.feature);
    }
    return points;
}

bool holds(const std::vector<std::uint32_t>& all, const std::vector<std::uint32_t>& some) {
    return std::includes(all.begin(), all.end(), some.begin(), some.end());
}

}  // namespace

TEST_CASE("a margin wider than the band has the contacts of a wide band") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const auto accuracy =
        GENERATE(ContactAccuracy::samples, ContactAccuracy::exactNearFeatures, ContactAccuracy::exact);
    // samples find the candidates in the band, and may differ by this from the triangles [voxels]
    constexpr float tolerance = 0.87f;
    // the normal filter may decide differently by samples and by triangles
    const bool isExact = accuracy == ContactAccuracy::exact;
    const Mesh torus = shapes::torus(0.35f, 0.13f), box = shapes::box({0.3f, 0.2f, 0.1f});
    const auto collider = [&](const Mesh& mesh, float exterior) {
        return Collider(mesh, build(mesh, {.voxelSize = h, .exteriorWidthVoxels = exterior}), {.accuracy = accuracy});
    };
    const Collider narrow[] = {collider(torus, 3), collider(box, 2)}, wide[] = {collider(torus, 14), collider(box, 14)};
    std::size_t beyond = 0;
    for (int i = 0; i < 60; ++i) {
        const Placed a{narrow[0], randomPose(random, 0.5)};
        const Placed b{narrow[i % 2], randomPose(random, 0.5), float(random(0.5, 2))};
        const float margin = float(random(1, 9)) * h;
        const ContactOptions options = isExact && i % 4 < 2 ? ContactOptions{.margin = margin} : unfiltered(margin);
        const float near = tolerance * h * std::max(b.scale, 1.f);
        const Placed wideA{wide[0], a.pose}, wideB{wide[i % 2], b.pose, b.scale};
        const auto found = pointsInContact(a, b, options, 0), surely = pointsInContact(a, b, options, near);
        CAPTURE(nameOf(accuracy), i, margin / h, b.scale);
        CHECK(holds(pointsInContact(wideA, wideB, options, 0), surely));
        CHECK(holds(found, pointsInContact(wideA, wideB, options, near)));
        beyond += margin > 3 * h ? found.size() : 0;
    }
    CHECK(beyond > 1000);
}

TEST_CASE("without triangles, a margin wider than the band takes the distances of the zero set") {
    const Mesh mesh = shapes::sphere(0.4f, 3);
    const LevelSet levelSet = levelSetOf(sphereSolid(0.4), h);
    const Collider body(withBody(levelSet, mesh, {}, false));
    std::vector<Contact> contacts;
    collide(body, {{0, 0, 0.8f + 3 * h}}, body, {}, {.margin = 4 * h}, contacts);
    REQUIRE(contacts.size() > 10);
    CHECK(minDistance(contacts) == Approx(3 * h).margin(0.05 * h));
}
}  // namespace bilayer::collide_test
