#include <bilayer/collider/collider.h>
#include <bilayer/collider/contact.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/constants.hpp>
#include <limits>
#include <map>
#include <set>
#include <stdexcept>

#include <bilayer/collider/mass.h>
#include <bilayer/sdf/build.h>
#include "collider/contact/collider_data.h"
#include "collider/contact/surface_query.h"
#include "demos/shared/machines.h"
#include "demos/shared/shapes.h"
#include "tests/support/analytic.h"
#include "tests/support/contacts.h"
#include "tests/support/random.h"
#include "tests/support/support.h"
#include "tests/support/truth.h"

using namespace bilayer;
using namespace bilayer::detail;
using namespace bilayer::test;

namespace {

constexpr float h = 0.02f;

const Collider& ball() {
    static const Collider collider(shapes::sphere(0.4f, 4), levelSetOf(sphereSolid(0.4), h));
    return collider;
}

const Collider& brick() {
    static const Collider collider(shapes::box({0.3f, 0.2f, 0.1f}), levelSetOf(boxSolid({0.3, 0.2, 0.1}), h));
    return collider;
}

const Collider& slab() {
    static const Collider collider(shapes::box({0.6f, 0.6f, 0.1f}), levelSetOf(boxSolid({0.6, 0.6, 0.1}), h));
    return collider;
}

const Collider& ring() {
    static const Collider collider(shapes::torus(0.35f, 0.13f), levelSetOf(torusSolid(0.35, 0.13), h));
    return collider;
}

std::vector<Contact> contactsOf(const Placed& a, const Placed& b, float margin, ContactReport* report = nullptr) {
    std::vector<Contact> contacts;
    const ContactReport seen = collide(a, b, unfiltered(margin), contacts);
    if (report) *report = seen;
    return contacts;
}

float deepest(const std::vector<Contact>& contacts) {
    float least = std::numeric_limits<float>::infinity();
    for (const Contact& contact : contacts) least = std::min(least, contact.distance);
    return least;
}

Pose randomPose(Random& random, double reach) {
    return {random.point(reach), glm::angleAxis(float(random(0, 6.28)), random.direction())};
}

Pose compose(const Pose& a, const Pose& b) {
    return {a.toWorld(b.position), a.rotation * b.rotation};
}

// Pairs of bodies in contact: one is moved until the other's surface is near its own.
std::vector<std::pair<Placed, Placed>> touchingPairs(Random& random) {
    std::vector<std::pair<Placed, Placed>> pairs;
    const std::vector<const Collider*> all{&ball(), &brick(), &slab(), &ring()};
    for (int i = 0; pairs.size() < 30 && i < 10000; ++i) {
        const Placed a{*all[i % 4], randomPose(random, 0.6)}, b{*all[i / 4 % 4], randomPose(random, 0.6)};
        const float depth = deepest(contactsOf(a, b, h));
        if (depth < 0 && depth > -1.5f * h) pairs.emplace_back(a, b);
    }
    REQUIRE(pairs.size() >= 10);
    return pairs;
}

}  // namespace

TEST_CASE("two balls touch where the line of their centres goes through") {
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
        REQUIRE(report.pointsTested < ball().data().points().points().size());
        // points are 2 voxels apart, so the nearest may miss the line by 1.25 spacings: 0.05 on a radius of 0.4
        REQUIRE(deepest(contacts) == Approx(gap).margin(0.0063));
        REQUIRE(deepest(contacts) >= gap - 0.02f * h);
        for (const Contact& contact : contacts) {
            REQUIRE(glm::length(contact.normal) == Approx(1).margin(1e-5));
            REQUIRE(contact.distance <= 2 * h);
            REQUIRE(glm::distance(contact.position, poseB.position) == Approx(0.4).margin(0.02 * h));
            const bool ofB = contact.feature & featureOfB;
            const glm::vec3 centre = ofB ? poseA.position : poseB.position;
            const glm::vec3 point = ofB ? contact.position : contact.position + contact.distance * contact.normal;
            const glm::vec3 expected = glm::normalize(ofB ? centre - point : point - centre);
            // a gradient rotates by h / R within a cell, so its error is at most half of that in either tangent
            // direction of the ball
            REQUIRE(glm::distance(contact.normal, expected) < std::sqrt(2.f) * 0.5f * h / (0.4f - 2 * h));
            REQUIRE(glm::dot(contact.normal, line) > 0.8f);
            REQUIRE(contact.distance == Approx(glm::distance(point, centre) - 0.4).margin(0.02 * h));
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

TEST_CASE("exchanged bodies have the same contacts, seen from the other side") {
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
    REQUIRE(deepest(contacts) == Approx(0.005).margin(0.0063));
    for (const Contact& contact : contacts) REQUIRE(glm::length(contact.position) == Approx(0.8).margin(0.04 * h));
}

// The feature of a contact: a surface point, or a place on a sharp edge between two of them.
SurfacePoint pointOf(const Collider& collider, std::uint32_t feature) {
    const auto points = collider.data().points().points();
    if (feature < points.size()) return points[feature];
    const SharpEdge& edge = collider.data().edges().edges()[feature - points.size()];
    const SurfacePoint &from = points[edge.from], &to = points[edge.to];
    return {0.5f * (from.position + to.position), glm::normalize(from.normal + to.normal), true};
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
            for (std::uint32_t i = 0; i < body.collider.data().points().points().size(); ++i) {
                const glm::vec3 world = body.pose.toWorld(body.collider.data().points().points()[i].position);
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
        total += a.collider.data().points().points().size() + b.collider.data().points().points().size();
    }
    REQUIRE(tested < total);  // a ball in a ring may need all of them, the pairs together do not
}

TEST_CASE("bodies apart have no contact and cost next to nothing") {
    ContactReport report;
    REQUIRE(contactsOf({ball(), {{5, 0, 0}}}, {ring()}, h, &report).empty());
    REQUIRE(report.pointsTested == 0);
    REQUIRE(contactsOf({ball(), {{1e30f, 0, 0}}}, {ring()}, h, &report).empty());
    // a small ball in the hole of a ring: their boxes overlap, the bodies do not
    REQUIRE(contactsOf({ball(), {}, 0.3f}, {ring()}, h, &report).empty());
    REQUIRE(report.pointsTested <
            (ball().data().points().points().size() + ring().data().points().points().size()) / 4);
    const float nan = std::numeric_limits<float>::quiet_NaN();
    REQUIRE(contactsOf({ball(), {{nan, 0, 0}}}, {ball()}, h, &report).empty());
    REQUIRE(report.beyondBand == 0);
}

TEST_CASE("a margin that is no number, or no length for a body of this size, is refused") {
    const Mesh mesh = shapes::box({1, 1, 1});
    const LevelSet field = build(mesh, {.voxelSize = 0.25f});
    for (const float margin : {std::numeric_limits<float>::quiet_NaN(), 251.f, 1e30f})
        CHECK_THROWS_AS(Collider(mesh, field, {.margin = margin}), std::invalid_argument);
    CHECK(Collider(mesh, field, {.margin = 249}).margin() == 249);
}

TEST_CASE("contacts that look along the surface of their point are left out where asked") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    std::size_t all = 0, kept = 0, back = 0, aslant = 0;
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
            ++aslant;
        }
    }
    CHECK(aslant < kept);
    REQUIRE(kept > 0);
    REQUIRE(kept + back < all);
}

TEST_CASE("tips that meet are pushed back the way they came, whatever they see of each other's sides") {
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

const Contact& nearestOf(const std::vector<Contact>& contacts) {
    const auto nearer = [](const Contact& one, const Contact& other) { return one.distance < other.distance; };
    return *std::min_element(contacts.begin(), contacts.end(), nearer);
}

TEST_CASE("beyond the band, edges are as far apart as those of the triangles, and look across") {
    const ContactAccuracy measure =
        GENERATE(ContactAccuracy::samples, ContactAccuracy::exactNearFeatures, ContactAccuracy::exact);
    const float gap = GENERATE(0.03f, 0.05f, 0.06f, 0.1f, 0.25f);
    const float scale = GENERATE(1.f, 10.f);
    const bool crosses = GENERATE(false, true);
    CAPTURE(nameOf(measure), gap, scale, crosses);
    // edge descent starts from points in contact
    const float beyond = crosses ? 0.02f : 0.001f;
    const Mesh mesh = shapes::box({0.3f, 0.2f, 0.1f});
    const Collider brick(mesh, build(mesh, {.voxelSize = h}), {.accuracy = measure});
    const float half = std::sqrt(0.5f), aside = half * gap, quarter = glm::pi<float>() / 4;
    // an edge next to and above another one, or above and across it
    Pose upper{{0.6f + aside, 0.01f, 0.2f + aside}}, lower;
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
    REQUIRE(!found.empty());
    const Contact& nearest = nearestOf(found);
    CAPTURE(nearest.distance / scale, nearest.normal.x, nearest.normal.y, nearest.normal.z);
    CHECK(nearest.distance == Approx(scale * gap).margin(1e-3 * scale * h));
    CHECK(glm::dot(nearest.normal, across) > 0.9999f);
}

TEST_CASE("what lies between two walls is found at any distance, whether the margin ends in the band or not") {
    const Mesh wall = shapes::box({0.1f, 0.5f, 0.5f}), small = shapes::box({0.1f, 0.1f, 0.1f});
    const Mesh walls = shapes::join({shapes::moved(wall, {-0.6f, 0, 0}), shapes::moved(wall, {0.6f, 0, 0})});
    const Collider two(walls, build(walls, {.voxelSize = h}), {.accuracy = ContactAccuracy::exact}),
        body(small, build(small, {.voxelSize = h}));
    for (float gap = 0.02f; gap < 0.2f; gap += 0.003f) {
        CAPTURE(gap);
        std::vector<Contact> found;
        const ContactOptions options{.margin = gap + 0.001f, .exact = true};
        collide(body, {{-0.4f + gap, 0.013f, 0.007f}}, two, {}, options, found);
        REQUIRE(!found.empty());
        const Contact& nearest = nearestOf(found);
        CHECK(nearest.distance == Approx(gap).margin(1e-4));
        CHECK(nearest.normal.x > 0.999f);
    }
}

TEST_CASE("what touches a face is told the face's direction, however near it is to an edge") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const glm::vec3 half(0.3f, 0.2f, 0.1f);
    for (int i = 0; i < 3000; ++i) {
        const int face = int(random(0, 3)), beside = (face + 1) % 3, along = (face + 2) % 3;
        const auto depth = float(random(-1e-3, 1e-3)), aside = float(random(0.03, 0.5));  // [voxels]
        glm::vec3 place(0);
        place[face] = half[face] + depth * h;
        place[beside] = half[beside] - aside * h;
        place[along] = float(random(-0.8, 0.8)) * half[along];
        CAPTURE(face, depth, aside);
        const SurfaceSample touch = surfaceSampleAt(brick().field(), place, brick().field().sample(place), false);
        REQUIRE(touch.normal[face] > 0.99f);
        REQUIRE(std::abs(touch.distance) < 2e-3f * h);
    }
}

TEST_CASE("points too deep for the band are counted") {
    ContactReport report;
    const auto contacts = contactsOf({brick(), {}, 0.5f}, {ball()}, 0, &report);
    REQUIRE(report.beyondBand == brick().data().points().points().size());
    REQUIRE(contacts.empty());
}

TEST_CASE("what was in the list stays, and the same question has the same answer") {
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

TEST_CASE("bodies whose fields the double layer method made touch within its error") {
    const Mesh mesh = shapes::box({0.3f, 0.2f, 0.1f});
    const Collider box(mesh, built(mesh, h));
    for (const float gap : {-1.f * h, 0.5f * h}) {
        const auto contacts = contactsOf({box, {{0.05f, 0.03f, 0.2f + gap}}}, {box}, h);
        REQUIRE_FALSE(contacts.empty());
        REQUIRE(deepest(contacts) == Approx(gap).margin(0.5 * h));
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
    const auto errors = [&](ContactAccuracy measure, const Pose& pose) {
        std::vector<Collider> parts;
        for (const Mesh& mesh : meshes)
            parts.emplace_back(mesh, build(mesh, {.voxelSize = voxel}), ColliderOptions{.accuracy = measure});
        const Pose poses[] = {pose, {}};
        std::vector<Contact> contacts;
        collide(parts[0], pose, parts[1], {}, {.margin = voxel / 2}, contacts);
        CHECK(contacts.size() > 500);
        Errors worst;
        for (const Contact& contact : contacts) {
            const int other = contact.feature & featureOfB ? 0 : 1;
            const auto points = parts[std::size_t(1 - other)].data().points().points();
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

TEST_CASE("a body of a mesh that faces the wrong way is the body of the right one") {
    const ContactAccuracy measure =
        GENERATE(ContactAccuracy::samples, ContactAccuracy::exactNearFeatures, ContactAccuracy::exact);
    const bool isShuffled = GENERATE(false, true);
    CAPTURE(nameOf(measure), isShuffled);
    const Mesh mesh = shapes::torus(0.35f, 0.13f);
    Mesh wrong = shapes::flipped(mesh);
    Random random(test::seed());
    if (isShuffled)
        for (glm::uvec3& t : wrong.triangles)
            if (random(0, 1) < 0.5) std::swap(t.y, t.z);
    const ColliderOptions options{.accuracy = measure};
    const Collider right(mesh, build(mesh, {.voxelSize = h}), options),
        repaired(wrong, build(wrong, {.voxelSize = h}), options);
    CHECK(repaired.mass().volume == Approx(right.mass().volume));
    CHECK(repaired.data().edges().edges().empty());
    REQUIRE(repaired.data().points().points().size() > 100);
    for (const SurfacePoint& point : repaired.data().points().points())
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
    CHECK(deepest(contacts) == Approx(deepest(expected)).margin(0.1 * h));
}

TEST_CASE("what moves on from beyond the band is met, however wide the margin is") {
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

TEST_CASE("a body whose mesh has holes, or one side only, has the mass of its field, and can be kept beside it") {
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
        if (body.data().body.mass) CHECK(body.mass().volume == massProperties(field).volume);
        const Collider kept(withBody(field, body.data().body));
        CHECK(kept.data().points().points().size() == body.data().points().points().size());
    }
    const Collider box(open, build(open, {.voxelSize = h}));
    CHECK(box.mass().volume == Approx(0.6 * 0.4 * 0.2).epsilon(0.05));
}

TEST_CASE("a collider refuses the level set of another mesh") {
    const Mesh mesh = shapes::box({0.3f, 0.2f, 0.1f});
    REQUIRE_THROWS_AS(Collider(mesh, build(shapes::sphere(0.4f, 4), {.voxelSize = h})), std::invalid_argument);
}

TEST_CASE("a collider refuses an empty mesh") {
    REQUIRE_THROWS_AS(Collider(Mesh{}, levelSetOf(sphereSolid(0.4), h)), std::invalid_argument);
}
