// SPDX-License-Identifier: Apache-2.0
// Contacts between a collider and shapes of other kinds, and the convex hull of points.
#include <bilayer/collider/shapes.h>

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <limits>
#include <map>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include <bilayer/collider/contact.h>
#include <bilayer/sdf/build.h>
#include "collider/contact/shapes/hull.h"
#include "demos/shared/shapes.h"
#include "tests/support/random.h"
#include "tests/support/support.h"

namespace bilayer::shapes_test {
using namespace bilayer::detail;
using namespace bilayer::test;

namespace {

constexpr float h = 0.02f;  // voxel size [m]

const ContactShape& block() {
    static const ContactShape shape = [] {
        const Mesh mesh = bilayer::shapes::box({0.5f, 0.4f, 0.3f});
        return ContactShape(
            Collider(mesh, build(mesh, {.voxelSize = h, .exteriorWidthVoxels = 5, .interiorWidthVoxels = 5})));
    }();
    return shape;
}

/// Waves of triangles over the xy plane, as a height field of cells.
OpenSurface flatSurface() {
    return {[](const Bounds& box, const OpenSurface::Visitor& visitor) {
        constexpr float cell = 0.23f;
        constexpr int count = 8;
        for (int x = -count; x < count; ++x)
            for (int y = -count; y < count; ++y) {
                const glm::vec2 low(cell * float(x), cell * float(y)), high = low + cell;
                if (high.x < box.lower.x || low.x > box.upper.x || high.y < box.lower.y || low.y > box.upper.y)
                    continue;
                const auto id = std::uint64_t((x + count) * 2 * count + y + count) * 2;
                visitor({glm::vec3(low, 0), {high.x, low.y, 0}, {high.x, high.y, 0}}, id);
                visitor({glm::vec3(low, 0), {high.x, high.y, 0}, {low.x, high.y, 0}}, id + 1);
            }
    }};
}

/// A shape with its pose so that its lowest point is the origin, and z is up.
struct Standing {
    std::string name;
    ContactShape shape;
    Pose pose;
};

std::vector<Standing> standing() {
    const glm::quat yToZ = glm::angleAxis(1.57079633f, glm::vec3(1, 0, 0));
    std::vector<glm::vec3> corners;
    for (int i = 0; i < 8; ++i) corners.push_back({i & 1 ? 0.1f : -0.1f, i & 2 ? 0.1f : -0.1f, i & 4 ? 0.15f : -0.15f});
    const std::array<SphereOfHull, 2> balls{{{{0, 0, 0}, 0.1f}, {{0.2f, 0, 0.05f}, 0.05f}}};
    return {{"sphere", ContactShape::sphere(0.2f), {{0, 0, 0.2f}}},
            {"box", ContactShape::box({0.1f, 0.2f, 0.15f}), {{0, 0, 0.15f}}},
            {"capsule", ContactShape::capsule(0.1f, 0.2f), {{0, 0, 0.3f}, yToZ}},
            {"lying capsule", ContactShape::capsule(0.1f, 0.2f), {{0, 0, 0.1f}}},
            {"cylinder", ContactShape::cylinder(0.15f, 0.1f), {{0, 0, 0.1f}, yToZ}},
            {"lying cylinder", ContactShape::cylinder(0.15f, 0.1f), {{0, 0, 0.15f}}},
            {"cone", ContactShape::cone(0.15f, 0.1f), {{0, 0, 0.1f}, yToZ}},
            {"hull", ContactShape::hull(corners), {{0, 0, 0.15f}}},
            {"rounded hull", ContactShape::hull(corners, 0.03f), {{0, 0, 0.18f}}},
            {"spheres", ContactShape::spheres(balls), {{0, 0, 0.1f}}}};
}

float deepest(const std::vector<Contact>& contacts) {
    float distance = std::numeric_limits<float>::infinity();
    for (const Contact& contact : contacts) distance = std::min(distance, contact.distance);
    return distance;
}

std::vector<Contact> contactsOf(const PlacedShape& a, const PlacedShape& b, const ContactOptions& options,
                                ContactCache* cache = nullptr) {
    std::vector<Contact> contacts;
    collide(a, b, options, contacts, cache);
    return contacts;
}

Pose compose(const Pose& a, const Pose& b) {
    return {a.toWorld(b.position), a.rotation * b.rotation};
}

Pose raised(Pose pose, float height) {
    pose.position.z += height;
    return pose;
}

}  // namespace

TEST_CASE("Shapes that stand on a box touch it at their lowest points, in either order, pose and scale") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (const Standing& one : standing())
        for (const float gap : {-0.6f * h, 0.f, 0.7f * h}) {
            const Pose world{3.f * random.direction(), glm::angleAxis(float(random(0, 3)), random.direction())};
            const auto scale = float(random(0.3, 3));
            CAPTURE(one.name, gap, scale);
            // off the lattice of voxels and surface points
            const glm::vec3 shift(0.013f, 0.007f, 0.3f + gap);
            Pose local{one.pose.position + shift, one.pose.rotation};
            local.position *= scale;
            const PlacedShape a{one.shape, compose(world, local), scale}, b{block(), world, scale};
            const auto contacts = contactsOf(a, b, {.margin = 1.5f * h * scale});
            REQUIRE(!contacts.empty());
            const glm::vec3 up = world.rotation * glm::vec3(0, 0, 1);
            CHECK(deepest(contacts) == Approx(gap * scale).margin(0.1f * h * scale));
            for (const Contact& contact : contacts) {
                CHECK(glm::dot(contact.normal, up) > 0.9f);
                CHECK(glm::dot(contact.position - world.position, up) == Approx(0.3f * scale).margin(0.1f * h * scale));
            }
            const auto swapped = contactsOf(b, a, {.margin = 1.5f * h * scale});
            REQUIRE(swapped.size() == contacts.size());
            for (std::size_t i = 0; i < contacts.size(); ++i) {
                CHECK(swapped[i].normal == -contacts[i].normal);
                CHECK(swapped[i].distance == contacts[i].distance);
                CHECK(swapped[i].feature == (contacts[i].feature ^ featureOfB));
                CHECK(glm::distance(swapped[i].position + swapped[i].distance * swapped[i].normal,
                                    contacts[i].position) < 1e-5f);
            }
        }
}

TEST_CASE("A box rests on planes and open surfaces") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const std::pair<std::string, ContactShape> grounds[] = {{"plane", ContactShape::plane({0, 0, 2.5f}, 0)},
                                                            {"sheet", ContactShape::triangles(flatSurface())}};
    for (const auto& [name, ground] : grounds)
        for (const float gap : {-0.6f * h, 0.f, 0.7f * h}) {
            const Pose world{3.f * random.direction(), glm::angleAxis(float(random(0, 3)), random.direction())};
            const auto scale = float(random(0.3, 3));
            CAPTURE(name, gap, scale);
            const Pose local{scale * glm::vec3(0.013f, 0.007f, 0.3f + gap)};
            const PlacedShape a{block(), compose(world, local), scale}, b{ground, world, scale};
            const auto contacts = contactsOf(a, b, {.margin = 1.5f * h * scale});
            REQUIRE(contacts.size() >= 4);
            const glm::vec3 up = world.rotation * glm::vec3(0, 0, 1);
            CHECK(deepest(contacts) == Approx(gap * scale).margin(1e-3f * h * scale));
            for (const Contact& contact : contacts) {
                CHECK(glm::dot(contact.normal, up) == Approx(1).margin(1e-4));
                CHECK(glm::dot(contact.position - world.position, up) == Approx(0).margin(1e-3f * h * scale));
            }
            // features stay after a small motion, but for points that it takes beyond the margin or over an edge
            std::set<std::uint32_t> before, after;
            for (const Contact& contact : contacts) before.insert(contact.feature);
            const PlacedShape next{block(), compose(world, {local.position + 1e-4f * scale, {1, 0, 0, 0}}), scale};
            for (const Contact& contact : contactsOf(next, b, {.margin = 1.5f * h * scale}))
                after.insert(contact.feature);
            const auto kept = std::count_if(before.begin(), before.end(),
                                            [&](std::uint32_t feature) { return after.count(feature) > 0; });
            CHECK(double(kept) >= 0.9 * double(before.size()));
            CHECK(double(kept) >= 0.9 * double(after.size()));
        }
}

TEST_CASE("Reduced contacts are few, hold the deepest one, and stay the same while bodies hardly move") {
    const auto shapes = standing();
    const auto box = std::find_if(shapes.begin(), shapes.end(), [](const Standing& one) { return one.name == "box"; });
    const PlacedShape ground{block(), {}};
    ContactCache cache;
    const ContactOptions all{.margin = h}, few{.margin = h, .reduced = true};
    std::set<std::uint32_t> first;
    for (int step = 0; step < 5; ++step) {
        const PlacedShape body{box->shape, raised(box->pose, 0.3f - 0.1f * h - 1e-6f * float(step))};
        const auto every = contactsOf(body, ground, all), kept = contactsOf(body, ground, few, &cache);
        REQUIRE(every.size() > 12);
        CHECK(kept.size() <= 12);
        CHECK(kept.size() >= 4);
        CHECK(deepest(kept) == Approx(deepest(every)).margin(1e-5));
        std::set<std::uint32_t> features;
        for (const Contact& contact : kept) features.insert(contact.feature);
        if (step == 0) first = features;
        CHECK(features == first);
        CHECK(contactsOf(body, ground, few).size() <= 12);
    }
    // two colliders
    const PlacedShape upper{block(), {{0.01f, 0.02f, 0.6f - 0.1f * h}}};
    CHECK(contactsOf(upper, ground, few).size() <= 12);
    CHECK(contactsOf(upper, ground, all).size() > 12);
}

TEST_CASE("A fast ball has a contact with what it will hit") {
    PlacedShape ball{ContactShape::sphere(0.1f), {{0.02f, 0.03f, 1}}};
    ball.motion.displacement = {0, 0, -2};
    {
        const auto contacts = contactsOf(ball, {block()}, {.margin = h});
        REQUIRE(!contacts.empty());
        // points around the lowest one meet the ball's side obliquely
        const auto straight =
            std::max_element(contacts.begin(), contacts.end(),
                             [](const Contact& a, const Contact& b) { return a.normal.z < b.normal.z; });
        CHECK(straight->normal.z > 0.99f);
        CHECK(straight->distance == Approx(0.6f).margin(0.2f * h));
        CHECK(straight->approach == Approx(2).margin(0.02));
        for (const Contact& contact : contacts) CHECK(contact.remaining() < 0);
    }
    ball.motion = {};
    CHECK(contactsOf(ball, {block()}, {.margin = h}).empty());
}

TEST_CASE("Shapes refuse what has no volume, and name it") {
    const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
    const auto refusal = [](const auto& make) -> std::string {
        try {
            make();
        } catch (const std::invalid_argument& error) {
            return error.what();
        }
        return {};
    };
    for (const float bad : {0.f, -1.f, nan, inf}) {
        CAPTURE(bad);
        CHECK(refusal([&] { ContactShape::sphere(bad); }).find("radius") != std::string::npos);
        CHECK(refusal([&] { ContactShape::box({1, bad, 1}); }).find("half extent") != std::string::npos);
        CHECK(refusal([&] { ContactShape::cylinder(1, bad); }).find("half height") != std::string::npos);
        CHECK(refusal([&] { ContactShape::cone(bad, 1); }).find("radius") != std::string::npos);
        if (!(bad < 0))
            CHECK(refusal([&] { ContactShape::plane({0, 0, bad}, 0); }).find("normal") != std::string::npos);
        CHECK(refusal([&] { ContactShape::spheres({{{{0, 0, 0}, bad}}}); }).find("radi") != std::string::npos);
        CHECK(refusal([&] { contactsOf({block(), {}, bad}, {block()}, {}); }).find("scale") != std::string::npos);
    }
    CHECK(refusal([] { ContactShape::capsule(1, -1); }).find("half height") != std::string::npos);
    CHECK(refusal([] { ContactShape::spheres({}); }).find("radii") != std::string::npos);
    CHECK(refusal([&] { ContactShape::plane({0, 0, 1}, nan); }).find("offset") != std::string::npos);
    CHECK(refusal([] { ContactShape::triangles({}); }).find("visit") != std::string::npos);
    const std::vector<glm::vec3> flat{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0.3f, 0.2f, 0}};
    CHECK(refusal([&] { ContactShape::hull(flat); }).find("plane") != std::string::npos);
    CHECK(refusal([&] { ContactShape::hull({}); }).find("plane") != std::string::npos);
    const std::vector<glm::vec3> line{{0, 0, 0}, {1, 1, 1}, {2, 2, 2}, {3, 3, 3}};
    CHECK(refusal([&] { ContactShape::hull(line); }).find("plane") != std::string::npos);
    const std::vector<glm::vec3> broken{{0, 0, 0}, {1, 0, 0}, {0, nan, 0}, {0, 0, 1}};
    CHECK(refusal([&] { ContactShape::hull(broken); }).find("point 2") != std::string::npos);
    const PlacedShape ball{ContactShape::sphere(1)};
    CHECK(refusal([&] { contactsOf(ball, ball, {}); }).find("collider") != std::string::npos);
}

TEST_CASE("The hull of points encloses them all, is closed, and has flat faces in one piece") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (int round = 0; round < 40; ++round) {
        const bool isBox = round % 2;
        const glm::quat rotation = glm::angleAxis(float(random(0, 3)), random.direction());
        std::vector<glm::vec3> points;
        for (int i = 0; i < 60; ++i) {
            glm::vec3 point(random(-1, 1), random(-1, 1), random(-1, 1));
            // corners of a box first, then points inside and on its faces
            if (isBox && i < 8) point = {i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1};
            if (isBox && i > 30) point[i % 3] = i % 2 ? 1 : -1;
            points.push_back(rotation * point);
        }
        const HullSurface hull = convexHullOf(points);
        CAPTURE(round, hull.points.size(), hull.faces.size());
        std::map<std::pair<std::uint32_t, std::uint32_t>, int> sides;
        for (const auto& face : hull.faces) {
            glm::dvec3 area(0);
            const glm::dvec3 apex(hull.points[face[0]]);
            for (std::size_t i = 0; i < face.size(); ++i) {
                ++sides[{face[i], face[(i + 1) % face.size()]}];
                area += glm::cross(glm::dvec3(hull.points[face[i]]) - apex,
                                   glm::dvec3(hull.points[face[(i + 1) % face.size()]]) - apex);
            }
            const glm::dvec3 normal = glm::normalize(area);
            for (const glm::vec3& point : points) REQUIRE(glm::dot(normal, glm::dvec3(point) - apex) < 1e-5);
        }
        for (const auto& [side, count] : sides) {
            REQUIRE(count == 1);
            REQUIRE(sides.count({side.second, side.first}) == 1);
        }
        CHECK(hull.points.size() + hull.faces.size() == hull.edges.size() + 2);
        if (!isBox) continue;
        CHECK(hull.points.size() == 8);
        CHECK(hull.faces.size() == 6);
    }
}
}  // namespace bilayer::shapes_test
