// SPDX-License-Identifier: Apache-2.0
// Times of impact of moving bodies against many distances along their motion, each by brute force over all pairs of
// triangles in double precision.
#define GLM_ENABLE_EXPERIMENTAL  // for the rotation between two vectors
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/gtx/quaternion.hpp>
#include <limits>
#include <stdexcept>

#include <bilayer/collider/distance.h>
#include <bilayer/sdf/build.h>
#include "demos/shared/shapes.h"
#include "tests/collider/surface_distance.h"
#include "tests/support/random_pose.h"
#include "tests/support/support.h"

namespace bilayer::time_of_impact_test {
using namespace bilayer::test;

namespace {

Collider colliderOf(const Mesh& mesh) {
    return {mesh, build(mesh, {.voxelSize = bounds(mesh).longestSide() / 32})};
}

// The body after a fraction of its motion, by quaternions in double precision.
Placed after(const Placed& body, double fraction) {
    const glm::dvec3 turned = fraction * glm::dvec3(body.motion.rotation);
    const double angle = glm::length(turned);
    const glm::dquat spin = angle > 0 ? glm::angleAxis(angle, turned / angle) : glm::dquat(1, 0, 0, 0);
    return {body.collider,
            {body.pose.position + float(fraction) * body.motion.displacement,
             glm::quat(spin * glm::dquat(body.pose.rotation))},
            body.scale};
}

/// A square of two triangles at z = 0.
OpenSurface squareSurface() {
    return {[](const Bounds& box, const OpenSurface::Visitor& visitor) {
        if (box.lower.z > 0 || box.upper.z < 0) return;
        visitor({glm::vec3(-9, -9, 0), {9, -9, 0}, {9, 9, 0}}, 0);
        visitor({glm::vec3(-9, -9, 0), {9, 9, 0}, {-9, 9, 0}}, 1);
    }};
}

/// A cube, and grounds at z = 0: a plane and an open surface.
struct BlockOverGrounds {
    float half = 0.3f;
    Collider block = colliderOf(shapes::box({half, half, half}));
    float voxel = block.field().voxelSize();
    PlacedShape grounds[2] = {{ContactShape::plane({0, 0, 1}, 0)}, {ContactShape::triangles(squareSurface())}};
};

/// Two rectangles that meet at x = 0 and z = 0.
/// @param left, right  heights at x = -9 and x = 9
OpenSurface bentSurface(float left, float right) {
    const std::array<Triangle, 4> triangles{Triangle{glm::vec3(-9, -9, left), {0, -9, 0}, {0, 9, 0}},
                                            {glm::vec3(-9, -9, left), {0, 9, 0}, {-9, 9, left}},
                                            {glm::vec3(0, -9, 0), {9, -9, right}, {9, 9, right}},
                                            {glm::vec3(0, -9, 0), {9, 9, right}, {0, 9, 0}}};
    return {[=](const Bounds&, const OpenSurface::Visitor& visitor) {
        for (std::uint64_t i = 0; i < 4; ++i) visitor(triangles[i], i);
    }};
}

}  // namespace

TEST_CASE("Moving bodies touch when samples of their motion say so, and never pass through each other") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const Collider shapes[] = {colliderOf(shapes::torus(0.5f, 0.2f, 12, 8)),
                               colliderOf(shapes::box({0.4f, 0.3f, 0.02f})), colliderOf(shapes::sphere(0.4f, 1))};
    int hits = 0, misses = 0;
    // one round in nine misses, so a few seeds need more rounds
    for (int round = 0; round < 150 || (misses <= 10 && round < 300); ++round) {
        Placed a{shapes[round % 3], randomPoseAt(random, 0), float(random(0.5, 2))};
        Placed b{shapes[round / 3 % 3], randomPoseAt(random, 3), float(random(0.5, 2))};
        // towards each other, some at many sizes a step, so that they meet, graze, or miss
        const float far = random(0, 1) < 0.3 ? 40.f : 6.f;
        b.motion = {-far / 3 * (b.pose.position + 0.7f * random.direction()), float(random(0, 6)) * random.direction()};
        a.motion = {0.5f * random.direction(), float(random(0, 6)) * random.direction()};
        const float voxel =
            std::min(a.scale * a.collider.field().voxelSize(), b.scale * b.collider.field().voxelSize());
        CAPTURE(round, far);
        const Impact impact = timeOfImpact(a, b);
        const Impact swapped = timeOfImpact(b, a);
        CHECK(impact.found == swapped.found);
        (impact.found ? hits : misses) += 1;
        if (impact.found) {
            const double then = surfaceDistance(after(a, double(impact.fraction)), after(b, double(impact.fraction)));
            CHECK(then <= 0.06 * double(voxel));
            CHECK(then > 0);
            CHECK(impact.distance.distance == Approx(then).margin(2e-5));
            CHECK(std::abs(impact.fraction - swapped.fraction) * far <= 0.2f * voxel + 1e-4f);
        }
        // no sample before it touches
        constexpr int samples = 300;
        for (int i = 0; i <= samples; ++i) {
            const double at = double(impact.found ? impact.fraction : 1) * i / samples;
            const BodyDistance separation = distance(after(a, at), after(b, at));
            if (!(separation.distance > 0) || separation.overlap != Overlap::none) FAIL_CHECK("touches at " << at);
        }
    }
    CHECK(hits > 30);
    CHECK(misses > 10);
}

TEST_CASE("A thin plate is met by a fast body at the time that the geometry says") {
    const Collider plate = colliderOf(shapes::box({1, 1, 0.01f})), ball = colliderOf(shapes::sphere(0.1f, 5));
    Placed moving{ball, {{0.3f, 0.2f, 5}}};
    moving.motion.displacement = {0, 0, -1000};
    const Placed fixed{plate};
    const Impact impact = timeOfImpact(moving, fixed);
    REQUIRE(impact.found);
    CHECK(1000 * impact.fraction == Approx(5 - 0.1 - 0.01).margin(0.1 * double(ball.field().voxelSize())));
    CHECK(impact.distance.normal.z == Approx(1).margin(1e-3));
    CHECK(impact.poseA.position.z == Approx(0.11).margin(1e-3));
    CHECK_FALSE(timeOfImpact(fixed, Placed{ball, {{0.3f, 0.2f, 5}}}).found);
}

TEST_CASE("A rotating bar meets a post where its end comes round") {
    const Collider bar = colliderOf(shapes::box({1, 0.05f, 0.05f})), post = colliderOf(shapes::box({0.05f, 0.05f, 1}));
    Placed rotating{bar};
    rotating.motion.rotation = {0, 0, glm::radians(180.f)};
    const Placed fixed{post, {{0, 0.9f, 0}}};
    const Impact impact = timeOfImpact(rotating, fixed);
    REQUIRE(impact.found);
    // the leading face at a distance of 0.05 from the axis meets the near corner of the post at (0.05, 0.85)
    const double angle = std::atan2(0.85, 0.05) - std::asin(0.05 / std::hypot(0.85, 0.05));
    CHECK(double(impact.fraction) * 180 == Approx(glm::degrees(angle)).margin(0.3));
}

TEST_CASE("Bodies that overlap touch at the start, and motions that are none are refused") {
    const Collider box = colliderOf(shapes::box({0.5f, 0.5f, 0.5f}));
    Placed a{box}, b{box, {{0.9f, 0, 0}}};
    a.motion.displacement = {-1, 0, 0};
    const Impact impact = timeOfImpact(a, b);
    CHECK(impact.found);
    CHECK(impact.fraction == 0);
    CHECK(impact.distance.overlap == Overlap::surfaces);
    b.motion.rotation = {0, std::numeric_limits<float>::quiet_NaN(), 0};
    CHECK_THROWS_AS(timeOfImpact(a, b), std::invalid_argument);
    b.motion.rotation = {0, 2000, 0};
    CHECK_THROWS_WITH(timeOfImpact(a, b), Catch::Matchers::Contains("1000 rad"));
}

TEST_CASE("A motion along a gap of hardly more than the tolerance ends, however long it is") {
    const float radius = 0.5f, angle = 900, tolerance = 1e-3f, gap = 1.02e-3f;
    const Collider ball = colliderOf(shapes::sphere(radius, 4)), wall = colliderOf(shapes::box({0.5f, 0.5f, 0.5f}));
    // the axis of the rotation goes through the vertex that is next to the wall
    const Placed spinning{ball, {{radius + gap, 0, 0}}, 1, {{0, 0, 0}, {angle, 0, 0}}}, still{wall, {{-0.5f, 0, 0}}};
    const Impact impact = timeOfImpact(spinning, still, {.tolerance = tolerance});
    REQUIRE(impact.found);
    CHECK(impact.distance.distance == Approx(gap).epsilon(0.01));
    // 10,000 steps, each as long as the gap less half of the tolerance, for the corners of the box around the ball
    CHECK(double(impact.fraction) * angle * radius * std::sqrt(3.0) ==
          Approx(1e4 * (gap - 0.5 * tolerance)).epsilon(0.02));
}

TEST_CASE("Bodies in contact rest, slide and part without penetration, and penetrate where they move on") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const float half = 0.3f;
    const Collider block = colliderOf(shapes::box({half, half, half}));
    const float voxel = block.field().voxelSize();
    const OpenSurface floor = squareSurface();
    const ContactShape box = ContactShape::box({9, 9, 1}), field(colliderOf(shapes::box({3, 3, 1})));
    const PlacedShape grounds[] = {{field, {{0, 0, -1}}},
                                   {box, {{0, 0, -1}}},
                                   {ContactShape::plane({0, 0, 1}, 0)},
                                   {ContactShape::triangles(floor)}};
    for (const PlacedShape& ground : grounds)
        for (int round = 0; round < 10; ++round) {
            CAPTURE(&ground - grounds, round);
            const auto along = float(random(0, 6));
            const glm::vec3 sideways = 1.5f * glm::vec3(std::cos(along), std::sin(along), 0);
            PlacedShape body{ContactShape(block), {{0, 0, half + 0.1f * voxel * float(random(-1, 1))}}};
            const auto penetrates = [&](const glm::vec3& displacement) {
                body.motion.displacement = displacement;
                const Impact impact = timeOfImpact(body, ground, {.penetration = true});
                const Impact swapped = timeOfImpact(ground, body, {.penetration = true});
                CHECK(impact.found == swapped.found);
                CHECK(impact.fraction == swapped.fraction);
                if (impact.found) CHECK(impact.distance.normal.z == Approx(1).margin(1e-3));
                if (swapped.found) CHECK(swapped.distance.normal.z == Approx(-1).margin(1e-3));
                return impact;
            };
            CHECK_FALSE(penetrates(sideways).found);
            CHECK_FALSE(penetrates(sideways + glm::vec3(0, 0, 1)).found);
            body.pose.position.z = 2;
            const glm::vec3 down(0, 0, -float(random(3, 500)));
            const Impact hit = penetrates(sideways + down);
            REQUIRE(hit.found);
            CHECK(std::abs(hit.poseA.position.z - half) < 0.6f * voxel);
            CHECK(std::abs(hit.distance.b.position.z) < 0.05f * voxel);
            CHECK_FALSE(penetrates(-down).found);
        }
    // a touch is at the start of all of these
    PlacedShape body{ContactShape(block), {{0, 0, half}}};
    body.motion.displacement = {1, 0, 0};
    CHECK(timeOfImpact(body, grounds[0]).fraction == 0);
    // two shapes without a field
    CHECK_THROWS_AS(timeOfImpact(grounds[1], grounds[2], {.penetration = true}), std::invalid_argument);
}

TEST_CASE("Bodies that have passed a surface by less than a voxel move on along it, out of it, but not deeper") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const BlockOverGrounds scene;
    const auto& [half, block, voxel, grounds] = scene;
    for (const PlacedShape& ground : grounds)
        for (int round = 0; round < 40; ++round) {
            // on a face, an edge or a vertex
            const glm::vec3 lowest = glm::normalize(glm::vec3(round % 3 > 1, round % 3 > 0, 1));
            PlacedShape body{ContactShape(block)};
            body.pose.rotation = glm::rotation(lowest, glm::vec3(0, 0, -1));
            const float depth = voxel * float(random(0.4, 0.8));
            body.pose.position.z = half * (lowest.x + lowest.y + lowest.z) - depth;
            CAPTURE(&ground - grounds, round, depth / voxel);
            const auto penetrates = [&](const glm::vec3& displacement) {
                body.motion.displacement = displacement;
                return timeOfImpact(body, ground, {.penetration = true});
            };
            const auto along = float(random(0, 6));
            const glm::vec3 sideways = 1.5f * glm::vec3(std::cos(along), std::sin(along), 0);
            CHECK_FALSE(penetrates(sideways).found);
            CHECK_FALSE(penetrates(sideways + glm::vec3(0, 0, 1)).found);
            const float down = float(random(0.2, 100)) * voxel;
            const Impact impact = penetrates(sideways - glm::vec3(0, 0, down));
            REQUIRE(impact.found);
            CHECK(impact.fraction * down <= 0.1f * voxel);
            CHECK(impact.distance.normal.z == Approx(1).margin(1e-3));
        }
    // a thin plate leaves a sheet that it rests on, or that its lower side has passed
    for (const float thickness : {0.7f, 1.f, 1.5f, 2.f, 3.f})
        for (const float depth : {-0.1f, 0.1f, 0.3f}) {
            const Collider plate(shapes::box({half, half, 0.5f * thickness * voxel}),
                                 build(shapes::box({half, half, 0.5f * thickness * voxel}), {.voxelSize = voxel}));
            PlacedShape body{ContactShape(plate), {{0.3f, 0.1f, (0.5f * thickness - depth) * voxel}}};
            CAPTURE(thickness, depth);
            body.motion.displacement = {1, 0, 1};
            CHECK_FALSE(timeOfImpact(body, grounds[1], {.penetration = true}).found);
        }
}

TEST_CASE("A body that is pressed into the ground step by step does not get deeper for ever") {
    const BlockOverGrounds scene;
    const auto& [half, block, voxel, grounds] = scene;
    for (const PlacedShape& ground : grounds)
        for (const float start : {0.f, 0.27f, 0.3f, 0.4f}) {
            CAPTURE(&ground - grounds, start);
            PlacedShape body{ContactShape(block), {{0.01f, 0.02f, half - start * voxel}}};
            body.motion.displacement = {0, 0, -0.09f * voxel};
            for (int step = 0; step < 50; ++step) {
                const Impact impact = timeOfImpact(body, ground, {.penetration = true});
                body.pose = impact.found ? impact.poseA : Pose{body.pose.position + body.motion.displacement};
            }
            CHECK((half - body.pose.position.z) / voxel < 0.5f);
        }
}

TEST_CASE("A ball that rolls into the ground is stopped next to the place where it enters") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const float radius = 0.1f, voxel = radius / 32;
    const Mesh sphere = shapes::sphere(radius, 5);
    const ContactShape ball(Collider(sphere, build(sphere, {.voxelSize = voxel})));
    const OpenSurface floor = squareSurface();
    const PlacedShape grounds[] = {{ContactShape(colliderOf(shapes::box({3, 3, 1}))), {{0, 0, -1}}},
                                   {ContactShape::box({9, 9, 1}), {{0, 0, -1}}},
                                   {ContactShape::plane({0, 0, 1}, 0)},
                                   {ContactShape::triangles(floor)}};
    int found = 0;
    for (int round = 0; round < 200; ++round) {
        PlacedShape body{ball, {{0, 0, radius + voxel * float(random(-0.2, 0.2))}, randomRotation(random)}};
        const auto angle = float(random(0.2, 0.9));
        body.motion = {{radius * angle, 0, -voxel * float(random(0.1, 0.8))}, {0, angle, 0}};
        const Impact impact = timeOfImpact(body, grounds[round % 4], {.penetration = true});
        if (!impact.found) continue;
        ++found;
        CAPTURE(round, angle, impact.fraction);
        const float outside = glm::distance(impact.distance.b.position, impact.poseA.position) - radius;
        CHECK(outside < 0.6f * voxel);
        CHECK(outside > -0.4f * voxel);
    }
    CHECK(found > 20);
}

TEST_CASE("A body that slides towards a crease of triangles is stopped in front of it a few times at most") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const float half = 0.3f;
    const Collider block = colliderOf(shapes::box({half, half, half}));
    const float voxel = block.field().voxelSize();
    for (int round = 0; round < 200; ++round) {
        // flat for negative x, a slope for positive x
        const float rise = 9 * std::tan(float(random(0.1, 0.4)));
        const OpenSurface sheet = bentSurface(0, rise);
        const PlacedShape ground{ContactShape::triangles(sheet)};
        PlacedShape body{ContactShape(block)};
        const float depth = float(random(0, 0.8)), height = float(random(0, 0.2));
        body.pose.position = {-half - voxel * float(random(0.1, 3)), 0, half - depth * voxel};
        body.motion.displacement = voxel * glm::vec3(random(4, 8), 0, height);
        CAPTURE(round, rise, depth);
        int stops = 0;
        for (float fraction = 0; fraction < 1 && stops < 9; ++stops) {
            const Impact impact = timeOfImpact(body, ground, {.penetration = true});
            if (body.pose.position.x + half > 0) break;
            fraction = impact.found ? impact.fraction : 1;
            body.pose.position += fraction * body.motion.displacement;
        }
        CHECK(stops <= 3);
    }
}

TEST_CASE("A body that slides over a ridge of triangles is not stopped by the plane of the slope behind it") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const float half = 0.3f;
    const Collider block = colliderOf(shapes::box({half, half, half}));
    const float voxel = block.field().voxelSize();
    for (int round = 0; round < 200; ++round) {
        // a slope for negative x, flat for positive x
        const auto slope = float(random(0.02, 0.12));
        const OpenSurface sheet = bentSurface(-9 * slope, 0);
        const glm::quat rotation = randomRotation(random);
        const PlacedShape ground{ContactShape::triangles(sheet), {{0, 0, 0}, rotation}};
        PlacedShape body{ContactShape(block), {{0, 0, 0}, rotation}};
        const auto depth = float(random(0.19, 0.24)), start = float(random(0.2, 3)), way = float(random(4, 7));
        body.pose.position = rotation * glm::vec3(-half - start * voxel, 0, half - depth * voxel);
        body.motion.displacement = rotation * glm::vec3(way * voxel, 0, 0);
        CAPTURE(round, slope, depth, start, way);
        CHECK_FALSE(timeOfImpact(body, ground, {.penetration = true}).found);
    }
}

TEST_CASE("A body that gets too deep beyond a ridge of triangles is stopped by the slope there") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const float half = 0.3f;
    const Collider block = colliderOf(shapes::box({half, half, half}));
    const float voxel = block.field().voxelSize();
    for (int round = 0; round < 100; ++round) {
        // A slope for negative x, flat for positive x. The block's lower front edge, which leads, enters the slope and
        // ends below the flat part.
        const auto slope = float(random(0.18, 0.22)), start = float(random(2.5, 3.2)), beyond = float(random(0.5, 1.2));
        const OpenSurface sheet = bentSurface(-9 * slope, 0);
        const glm::quat rotation = randomRotation(random),
                        dive = glm::angleAxis(float(random(0.3, 0.6)), glm::vec3(0, 1, 0));
        const PlacedShape ground{ContactShape::triangles(sheet), {{0, 0, 0}, rotation}};
        const glm::vec3 edge = voxel * glm::vec3(-start, 0, -slope * start - 0.1f);
        PlacedShape body{ContactShape(block), {rotation * (edge - dive * glm::vec3(half, 0, -half)), rotation * dive}};
        body.motion.displacement = rotation * glm::vec3((start + beyond) * voxel, 0, 0);
        CAPTURE(round, slope, start, beyond);
        const Impact impact = timeOfImpact(body, ground, {.penetration = true});
        REQUIRE(impact.found);
        CHECK(std::abs(glm::dot(impact.distance.normal, rotation * glm::vec3(0, 0, 1))) > 0.9999f);
    }
}
}  // namespace bilayer::time_of_impact_test
