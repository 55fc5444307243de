// SPDX-License-Identifier: Apache-2.0
// Distances of shapes from colliders against brute force: the smallest distance over each triangle of a formula in
// double precision.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <functional>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include <bilayer/collider/distance.h>
#include <bilayer/sdf/build.h>
#include "collider/contact/distance/gjk.h"
#include "demos/shared/shapes.h"
#include "tests/collider/surface_distance.h"
#include "tests/support/random_pose.h"
#include "tests/support/support.h"

namespace bilayer::shape_distance_test {
using namespace bilayer::test;

namespace {

using Formula = std::function<double(const glm::dvec3&)>;  // signed distance in the shape's coordinates

struct Subject {
    std::string name;
    ContactShape shape;
    Formula distance;
};

double toBox(const glm::dvec3& point, const glm::dvec3& half) {
    const glm::dvec3 q = glm::abs(point) - half;
    return glm::length(glm::max(q, 0.0)) + std::min(std::max({q.x, q.y, q.z}), 0.0);
}

double toSegment(const glm::dvec2& p, const glm::dvec2& a, const glm::dvec2& b) {
    const double t = std::clamp(glm::dot(p - a, b - a) / glm::dot(b - a, b - a), 0.0, 1.0);
    return glm::distance(p, a + t * (b - a));
}

// The smallest value of a convex function between 0 and 1.
template <class Function>
double minimum(const Function& f) {
    double low = 0, high = 1;
    for (int i = 0; i < 80; ++i) {
        const double one = low + (high - low) * 0.45, two = low + (high - low) * 0.55;
        if (f(one) < f(two))
            high = two;
        else
            low = one;
    }
    return std::min({f(low), f(0), f(1)});
}

std::vector<Subject> subjects() {
    std::vector<glm::vec3> corners;
    for (int i = 0; i < 8; ++i) corners.push_back({i & 1 ? 0.1f : -0.1f, i & 2 ? 0.2f : -0.2f, i & 4 ? 0.3f : -0.3f});
    const glm::dvec3 half(0.1f, 0.2f, 0.3f);
    const SphereOfHull balls[] = {{{0, 0, 0}, 0.2f}, {{0.4f, 0, 0.1f}, 0.05f}};
    const double r = 0.15f, h = 0.25f;
    return {{"sphere", ContactShape::sphere(0.2f), [](const glm::dvec3& p) { return glm::length(p) - double(0.2f); }},
            {"box", ContactShape::box(half), [half](const glm::dvec3& p) { return toBox(p, half); }},
            {"hull", ContactShape::hull(corners), [half](const glm::dvec3& p) { return toBox(p, half); }},
            {"rounded hull", ContactShape::hull(corners, 0.05f),
             [half](const glm::dvec3& p) { return toBox(p, half) - double(0.05f); }},
            {"capsule", ContactShape::capsule(0.15f, 0.25f),
             [=](const glm::dvec3& p) {
                 return glm::distance(p, {0, std::clamp(p.y, -h, h), 0}) - r;
             }},
            {"cylinder", ContactShape::cylinder(0.15f, 0.25f),
             [=](const glm::dvec3& p) {
                 const glm::dvec2 q(std::hypot(p.x, p.z) - r, std::abs(p.y) - h);
                 return glm::length(glm::max(q, 0.0)) + std::min(std::max(q.x, q.y), 0.0);
             }},
            {"cone", ContactShape::cone(0.15f, 0.25f),
             [=](const glm::dvec3& p) {
                 const glm::dvec2 q(std::hypot(p.x, p.z), p.y), rim(r, -h), apex(0, h);
                 const double d = std::min(toSegment(q, rim, apex), toSegment(q, {0, -h}, rim));
                 const bool inside = q.y > -h && r * (h - q.y) > q.x * 2 * h;
                 return inside ? -d : d;
             }},
            {"spheres", ContactShape::spheres(balls), [](const glm::dvec3& p) {
                 return minimum([&](double t) {
                     const glm::dvec3 to(0.4f, 0, 0.1f);
                     return glm::distance(p, t * to) - (double(0.2f) + t * (double(0.05f) - double(0.2f)));
                 });
             }}};
}

// The smallest distance of a triangle; the formula is convex over it.
double ofTriangle(const Formula& f, const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c) {
    return minimum([&](double u) {
        const glm::dvec3 from = a + u * (b - a), to = a + u * (c - a);
        return minimum([&](double v) { return f(from + v * (to - from)); });
    });
}

// The distance of the surface of a collider by brute force [m].
double bruteForce(const Subject& subject, const PlacedShape& placed, const Placed& body) {
    const glm::dquat back = glm::conjugate(glm::normalize(glm::dquat(placed.pose.rotation)));
    const auto own = [&](const glm::vec3& point) {
        return back * (inWorld(body, glm::dvec3(point)) - glm::dvec3(placed.pose.position)) / double(placed.scale);
    };
    struct Candidate {
        double bound;
        glm::dvec3 corners[3];
    };
    std::vector<Candidate> candidates;
    const Mesh& mesh = body.collider.mesh();
    for (const glm::uvec3& t : mesh.triangles) {
        Candidate one{0, {own(mesh.points[t.x]), own(mesh.points[t.y]), own(mesh.points[t.z])}};
        const glm::dvec3 middle = (one.corners[0] + one.corners[1] + one.corners[2]) / 3.0;
        double radius = 0;
        for (const glm::dvec3& corner : one.corners) radius = std::max(radius, glm::distance(corner, middle));
        one.bound = subject.distance(middle) - radius;
        candidates.push_back(one);
    }
    std::sort(candidates.begin(), candidates.end(),
              [](const Candidate& a, const Candidate& b) { return a.bound < b.bound; });
    double best = std::numeric_limits<double>::infinity();
    for (const Candidate& one : candidates) {
        if (one.bound >= best) break;
        best = std::min(best, ofTriangle(subject.distance, one.corners[0], one.corners[1], one.corners[2]));
    }
    return best * double(placed.scale);
}

Collider colliderOf(const Mesh& mesh) {
    return {mesh, build(mesh, {.voxelSize = bounds(mesh).longestSide() / 48})};
}

const std::vector<Collider>& colliders() {
    static const std::vector<Collider> all{colliderOf(shapes::torus(0.5f, 0.2f, 16, 10)),
                                           colliderOf(shapes::box({0.4f, 0.3f, 0.25f})),
                                           colliderOf(shapes::sphere(0.4f, 2))};
    return all;
}

}  // namespace

TEST_CASE("The distance of a shape from a collider is that of brute force, with witnesses on both, in either order") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    int separatedCount = 0;
    for (const Subject& subject : subjects())
        for (int round = 0; round < 24; ++round) {
            const Collider& collider = colliders()[std::size_t(round % 3)];
            const ContactShape field(collider);
            const double size = 0.5 + 0.5 * (round % 4), away = round % 2 ? random(0.3, 1.5) : random(1, 30);
            const PlacedShape a{subject.shape, randomPoseAt(random, away), float(random(0.5, 2))};
            const PlacedShape b{field, randomPoseAt(random, 0.2), float(size)};
            const Placed body{collider, b.pose, b.scale};
            CAPTURE(subject.name, round);
            const double expected = bruteForce(subject, a, body);
            DistanceStart start;
            const BodyDistance found = distance(a, b, {}, &start);
            REQUIRE(found.found);
            if (!(expected > 1e-5)) continue;
            if (found.overlap == Overlap::aInsideB) continue;
            ++separatedCount;
            REQUIRE(found.overlap == Overlap::none);
            CHECK(found.distance == Approx(expected).margin(2e-6 * std::max(size, away)));
            // the witnesses
            const glm::dquat back = glm::conjugate(glm::normalize(glm::dquat(a.pose.rotation)));
            const auto shapeDistance = [&](const glm::vec3& point) {
                return subject.distance(back * glm::dvec3(point - a.pose.position) / double(a.scale)) * double(a.scale);
            };
            CHECK(shapeDistance(found.a.position) == Approx(0).margin(1e-5 * std::max(1.0, away)));
            CHECK(shapeDistance(found.b.position) == Approx(expected).margin(1e-5 * std::max(1.0, away)));
            CHECK(glm::distance(found.a.position, found.b.position) ==
                  Approx(expected).margin(1e-5 * std::max(1.0, away)));
            CHECK(glm::distance(glm::normalize(found.a.position - found.b.position), found.normal) <
                  1e-5 * std::max(1.0, away) / expected);
            REQUIRE(found.b.triangle < collider.mesh().triangles.size());
            // a start changes nothing, nor does the order
            CHECK(distance(a, b, {}, &start).distance == Approx(found.distance).margin(1e-6 * size));
            const BodyDistance swapped = distance(b, a);
            CHECK(swapped.distance == found.distance);
            CHECK(swapped.normal == -found.normal);
            CHECK(swapped.a.position == found.b.position);
            // a limit
            CHECK(!distance(a, b, {.maxDistance = float(0.99 * expected)}).found);
            CHECK(distance(a, b, {.maxDistance = float(1.01 * expected)}).found);
        }
    CHECK(separatedCount > 100);
}

TEST_CASE("Shapes that overlap a collider are distinguished from those inside it and around it") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const Collider& block = colliders()[1];
    const ContactShape field(block);
    for (const Subject& subject : subjects()) {
        CAPTURE(subject.name);
        const Pose pose = randomPoseAt(random, 2);
        const PlacedShape b{field, pose};
        // a limit of zero finds each of them
        const auto overlapWithin = [&](const PlacedShape& a) { return distance(a, b, {.maxDistance = 0}).overlap; };
        // inside
        const BodyDistance inside = distance({subject.shape, pose, 0.2f}, b);
        CHECK(overlapWithin({subject.shape, pose, 0.2f}) == Overlap::aInsideB);
        CHECK(inside.overlap == Overlap::aInsideB);
        CHECK(inside.distance < -0.1f);
        CHECK(distance(b, {subject.shape, pose, 0.2f}).overlap == Overlap::bInsideA);
        // around
        const BodyDistance around = distance({subject.shape, pose, 40}, b);
        CHECK(around.overlap == Overlap::bInsideA);
        CHECK(around.distance < 0);
        CHECK(overlapWithin({subject.shape, pose, 40}) == Overlap::bInsideA);
        // on a face, by a hundredth
        const glm::vec3 up = pose.rotation * glm::vec3(0, 0, 1);
        float lowest = std::numeric_limits<float>::infinity();
        const glm::quat rotation = glm::angleAxis(float(random(0, 3)), random.direction());
        const BodyDistance above =
            distance({subject.shape, {pose.toWorld({0.03f, 0.02f, 3}), pose.rotation * rotation}, 0.4f}, b);
        lowest = above.distance;
        const glm::vec3 place = pose.toWorld({0.03f, 0.02f, 3 - lowest - 0.01f});
        const BodyDistance deep = distance({subject.shape, {place, pose.rotation * rotation}, 0.4f}, b);
        CHECK(deep.overlap == Overlap::surfaces);
        CHECK(overlapWithin({subject.shape, {place, pose.rotation * rotation}, 0.4f}) == Overlap::surfaces);
        CHECK(deep.distance == Approx(-0.01f).margin(0.0008));
        CHECK(glm::dot(deep.normal, up) > 0.95f);
        // their poses count, not their motions
        PlacedShape moving{subject.shape, {place, pose.rotation * rotation}, 0.4f}, movingB = b;
        moving.motion = {random.direction(), random.direction()};
        movingB.motion = {random.direction(), random.direction()};
        const BodyDistance same = distance(moving, movingB);
        CHECK(same.distance == deep.distance);
        CHECK(same.normal == deep.normal);
    }
}

TEST_CASE("A limit of zero finds a small collider that touches a large shape") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const Collider& block = colliders()[1];
    for (int i = 0; i < 100; ++i) {
        CAPTURE(i);
        const auto depth = float(random(0, 1e-4));
        const Pose pose = randomPoseAt(random, 2);
        const float size = 500, top = block.bounds().upper.z;
        // the block's upper face, against the lower face of a large box
        const PlacedShape ground{
            ContactShape::box(glm::vec3(size)),
            {pose.toWorld({random(-100, 100), random(-100, 100), top + size - depth}), pose.rotation}};
        CHECK(distance(ground, {ContactShape(block), pose}, {.maxDistance = 0}).found);
    }
}

TEST_CASE("Planes and open surfaces have the distance of the lowest vertex of a body") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const OpenSurface quad{[](const Bounds& box, const OpenSurface::Visitor& visitor) {
        if (box.lower.z > 0 || box.upper.z < 0) return;
        visitor({glm::vec3(-50, -50, 0), {50, -50, 0}, {50, 50, 0}}, 0);
        visitor({glm::vec3(-50, -50, 0), {50, 50, 0}, {-50, 50, 0}}, 1);
    }};
    for (int round = 0; round < 30; ++round) {
        const Collider& collider = colliders()[std::size_t(round % 3)];
        const Pose world = randomPoseAt(random, 3), local = randomPoseAt(random, 0);
        const auto height = float(round % 3 ? random(0.8, 5) : random(-0.3, 0.3)), scale = float(random(0.5, 2));
        const Pose pose{world.toWorld({0, 0, height}), world.rotation * local.rotation};
        const PlacedShape b{ContactShape(collider), pose, scale};
        double lowest = std::numeric_limits<double>::infinity(), highest = -lowest;
        const glm::dvec3 up = glm::normalize(glm::dquat(world.rotation)) * glm::dvec3(0, 0, 1);
        for (const glm::vec3& point : collider.mesh().points) {
            const double z =
                glm::dot(up, inWorld({collider, pose, scale}, glm::dvec3(point)) - glm::dvec3(world.position));
            lowest = std::min(lowest, z), highest = std::max(highest, z);
        }
        CAPTURE(round, lowest, highest);
        const BodyDistance plane = distance({ContactShape::plane({0, 0, 1}, 0), world}, b);
        REQUIRE(plane.found);
        CHECK(plane.distance == Approx(lowest).margin(5e-6));
        CHECK(plane.overlap == (lowest > 0 ? Overlap::none : highest < 0 ? Overlap::bInsideA : Overlap::surfaces));
        CHECK(glm::distance(plane.normal, glm::vec3(-up)) < 1e-5f);
        CHECK(plane.b.feature == Feature::vertex);
        if (std::abs(lowest) > 1e-4)
            CHECK(distance({ContactShape::plane({0, 0, 1}, 0), world}, b, {.maxDistance = 0}).overlap == plane.overlap);
        const BodyDistance sheet = distance({ContactShape::triangles(quad), world}, b);
        REQUIRE(sheet.found);
        if (lowest > 1e-4) {
            CHECK(sheet.overlap == Overlap::none);
            CHECK(sheet.distance == Approx(lowest).margin(5e-6));
            CHECK(!distance({ContactShape::triangles(quad), world}, b, {.maxDistance = float(0.9 * lowest)}).found);
        } else if (lowest < -1e-4 && highest > 1e-4) {
            CHECK(sheet.overlap == Overlap::surfaces);
            CHECK(sheet.distance <= 0);
            CHECK(distance({ContactShape::triangles(quad), world}, b, {.maxDistance = 0}).distance == sheet.distance);
        }
    }
}

TEST_CASE("Moving shapes touch a collider when samples of their motion say so") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const ContactShape field(colliders()[0]);
    const float voxel = colliders()[0].field().voxelSize(), tolerance = 0.05f * voxel;
    int hits = 0;
    for (const Subject& subject : subjects())
        for (int round = 0; round < 8; ++round) {
            PlacedShape a{subject.shape, randomPoseAt(random, 3)};
            const PlacedShape b{field, randomPoseAt(random, 0)};
            a.motion = {-1.5f * a.pose.position + 0.7f * random.direction(), float(random(0, 5)) * random.direction()};
            CAPTURE(subject.name, round);
            const Impact impact = timeOfImpact(a, b);
            CHECK(timeOfImpact(b, a).found == impact.found);
            hits += impact.found;
            if (impact.found) {
                CHECK(impact.distance.distance <= tolerance * 1.01f);
                CHECK(impact.distance.distance > -tolerance);
            }
            // nothing touches before
            const float end = impact.found ? impact.fraction : 1.f;
            for (int i = 0; i < 100; ++i) {
                const float part = end * float(i) / 100;
                const float angle = part * glm::length(a.motion.rotation);
                const glm::quat turn =
                    angle > 0 ? glm::angleAxis(angle, glm::normalize(a.motion.rotation)) : glm::quat(1, 0, 0, 0);
                const PlacedShape now{a.shape,
                                      {a.pose.position + part * a.motion.displacement, turn * a.pose.rotation}};
                REQUIRE(distance(now, b).distance > 0.3f * tolerance);
            }
        }
    CHECK(hits > 10);
    // a ball against a plane, by formula
    PlacedShape ball{ContactShape(colliders()[2]), {{0, 0, 2}}};
    ball.motion.displacement = {0, 0, -4};
    const Impact onPlane = timeOfImpact(ball, {ContactShape::plane({0, 0, 1}, 0)});
    REQUIRE(onPlane.found);
    CHECK(onPlane.fraction == Approx(0.4).margin(0.01));
    PlacedShape turning{ContactShape::plane({0, 0, 1}, 0)};
    turning.motion.rotation = {0, 0.1f, 0};
    CHECK_THROWS_AS(timeOfImpact(ball, turning), std::invalid_argument);
}

TEST_CASE("Two convex sets have the distance of their closest points") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    // boxes whose sides are parallel, in a common rotation
    for (int round = 0; round < 300; ++round) {
        const glm::dquat rotation(glm::angleAxis(float(random(0, 3)), random.direction()));
        const glm::dvec3 half(random(0.1, 2), random(0.1, 2), random(0.1, 2)),
            other(random(0.1, 2), random(0.1, 2), random(0.1, 2));
        const glm::dvec3 shift(5.0 * glm::dvec3(random.point(1)));
        const auto supportOf = [&](const glm::dvec3& extents, const glm::dvec3& centre, const glm::dvec3& direction) {
            const glm::dvec3 own = glm::conjugate(rotation) * direction;
            return rotation *
                   (centre + extents * glm::dvec3(own.x < 0 ? -1 : 1, own.y < 0 ? -1 : 1, own.z < 0 ? -1 : 1));
        };
        const detail::ConvexPair pair = detail::convexDistance(
            [&](const glm::dvec3& d) {
                return std::pair(supportOf(half, {0, 0, 0}, d), 0);
            },
            [&](const glm::dvec3& d) { return supportOf(other, shift, d); }, 1e-9,
            std::numeric_limits<double>::infinity());
        const double expected = glm::length(glm::max(glm::abs(shift) - half - other, 0.0));
        CAPTURE(round, expected);
        REQUIRE(pair.distance == Approx(expected).margin(1e-8));
        if (expected > 0) CHECK(glm::distance(pair.onA, pair.onB) == Approx(expected).margin(1e-8));
    }
}

TEST_CASE("Convex sets that meet are at distance zero, whatever their size") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (int round = 0; round < 2000; ++round) {
        const double size = std::pow(10, random(-30, 30));
        const glm::dquat rotation(glm::angleAxis(float(random(0, 3)), random.direction()));
        const auto supportOf = [&](const glm::dvec3& direction) {
            const glm::dvec3 own = glm::conjugate(rotation) * direction;
            return size * (rotation * glm::dvec3(own.x < 0 ? -1 : 1, own.y < 0 ? -1 : 1, own.z < 0 ? -1 : 1));
        };
        const glm::dvec3 point(size * 0.5 * glm::dvec3(random.point(1)));
        // a tolerance that is below the rounding of large sets
        const detail::ConvexPair pair = detail::convexDistance(
            [&](const glm::dvec3& d) { return std::pair(supportOf(d), 0); }, [&](const glm::dvec3&) { return point; },
            1e-9, std::numeric_limits<double>::infinity());
        CAPTURE(round, size);
        REQUIRE(pair.simplex.count <= 4);
        REQUIRE(pair.distance <= 1e-12 * size);
    }
}
}  // namespace bilayer::shape_distance_test
