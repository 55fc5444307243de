// SPDX-License-Identifier: Apache-2.0
// Distances of posed bodies against brute force over all pairs of triangles in double precision.
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <limits>
#include <vector>

#include <bilayer/collider/distance.h>
#include <bilayer/sdf/build.h>
#include <bilayer/sdf/mesh_io.h>
#include "collider/contact/distance/triangle_distance.h"
#include "demos/shared/shapes.h"
#include "tests/collider/surface_distance.h"
#include "tests/support/random_pose.h"
#include "tests/support/support.h"

namespace bilayer::distance_test {
using namespace bilayer::detail;
using namespace bilayer::test;

namespace {

constexpr double exactness = 1e-6;  // promised error of distances [sizes of the larger body]

Collider colliderOf(const Mesh& mesh, float resolution = 48) {
    return Collider(mesh, build(mesh, {.voxelSize = voxelSizeFor(mesh, resolution)}));
}

double sizeOf(const Placed& body) {
    return double(body.scale * body.collider.bounds().longestSide());
}

// The point lies on the triangle and feature that the answer names.
void checkWitness(const Placed& body, const WitnessPoint& point, double room) {
    const Mesh& mesh = body.collider.mesh();
    REQUIRE(point.triangle < mesh.triangles.size());
    const auto corner = [&](int i) {
        return inWorld(body, glm::dvec3(mesh.points[mesh.triangles[point.triangle][i % 3]]));
    };
    const int from = point.feature == Feature::face ? 0 : point.index;
    const glm::dvec3 a = corner(from), b = point.feature == Feature::vertex ? a : corner(from + 1),
                     c = point.feature == Feature::face ? corner(2) : b;
    CHECK(std::sqrt(squaredDistance(glm::dvec3(point.position), a, b, c)) <= room);
}

// Checks the answer for separated bodies, and returns whether they were separated.
bool checkSeparated(const Placed& a, const Placed& b) {
    const double truth = surfaceDistance(a, b), size = std::max(sizeOf(a), sizeOf(b));
    const BodyDistance answer = distance(a, b);
    REQUIRE(answer.found);
    CHECK((answer.overlap == Overlap::surfaces) == (truth == 0));
    if (answer.overlap != Overlap::none) return false;
    CHECK(double(answer.distance) == Approx(truth).margin(exactness * size));
    const double room =
        exactness * (size + double(glm::length(a.pose.position)) + double(glm::length(b.pose.position)));
    checkWitness(a, answer.a, room);
    checkWitness(b, answer.b, room);
    CHECK(double(glm::distance(answer.a.position, answer.b.position)) == Approx(truth).margin(2 * room));
    if (truth > 1e-3 * size) {
        const glm::vec3 between = answer.a.position - answer.b.position;
        CHECK(glm::distance(answer.normal, glm::normalize(between)) < 1e-2f);
    }
    return true;
}

}  // namespace

TEST_CASE("Triangles are as far apart as brute force says, whatever their shape") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (int i = 0; i < 20000; ++i) {
        CAPTURE(i);
        const auto triangle = [&](double offset) {
            TriangleCorners c;
            for (glm::dvec3& corner : c) corner = glm::dvec3(random.point(1)) + glm::dvec3(offset, 0, 0);
            const int kind = int(random(0, 8));
            if (kind == 0) c[2] = c[1];                                                  // a segment
            if (kind == 1) c[1] = c[2] = c[0];                                           // a point
            if (kind == 2) c[2] = 0.5 * (c[0] + c[1]) + glm::dvec3(random.point(1e-7));  // a sliver
            if (kind == 3)
                for (glm::dvec3& corner : c) corner.z = 0;  // coplanar with others
            return c;
        };
        const TriangleCorners a = triangle(0), b = triangle(random(0, 3));
        const double truth = std::sqrt(triangleDistance2(a, b));
        const TrianglePair pair = closestPoints(a, b);
        CHECK(std::sqrt(pair.distance2) == Approx(truth).margin(1e-7));
        CHECK(glm::distance(pair.a.position, pair.b.position) == Approx(std::sqrt(pair.distance2)).margin(1e-12));
        CHECK(squaredDistance(pair.a.position, a[0], a[1], a[2]) < 1e-14);
        CHECK(squaredDistance(pair.b.position, b[0], b[1], b[2]) < 1e-14);
    }
}

TEST_CASE("Bodies are as far apart as their triangles") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const std::vector<Collider> bodies{
        colliderOf(shapes::torus(0.5f, 0.15f, 48, 24)), colliderOf(shapes::box({0.5f, 0.3f, 0.1f})),
        colliderOf(shapes::torusKnot(2, 3, 0.5f, 0.1f, 150, 12)), colliderOf(shapes::bowl(0.5f, 0.06f, 32)),
        colliderOf(shapes::cone(0.4f, 1, 24))};
    int separated = 0;
    for (int i = 0; i < 400; ++i) {
        CAPTURE(i);
        const auto body = [&] { return std::size_t(random(0, double(bodies.size()) - 1e-9)); };
        const double reach = std::pow(10, random(-0.5, 3));
        const Placed a{bodies[body()], randomPose(random, reach), float(random(0.2, 3))},
            b{bodies[body()], randomPose(random, reach), float(random(0.2, 3))};
        separated += checkSeparated(a, b);
    }
    CHECK(separated > 200);
}

TEST_CASE("Meshes of the corpus are as far apart as their triangles", "[corpus]") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    std::vector<Collider> bodies;
    for (const char* name : {"fandisk.obj", "spot.obj", "suzanne.obj", "duck.obj"})
        if (const auto path = corpusMesh(name)) bodies.push_back(colliderOf(readMesh(*path), 64));
    if (bodies.size() < 2) return;
    int separated = 0;
    for (int i = 0; i < 40; ++i) {
        CAPTURE(i);
        const std::size_t first = std::size_t(i) % bodies.size(), second = std::size_t(i / 2) % bodies.size();
        const double size = double(bodies[first].bounds().longestSide());
        const Placed a{bodies[first], randomPose(random, size)},
            b{bodies[second], randomPose(random, size),
              bodies[first].bounds().longestSide() / bodies[second].bounds().longestSide()};
        separated += checkSeparated(a, b);
    }
    CHECK(separated > 10);
}

TEST_CASE("A start changes the speed of a distance, not the distance") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const Collider torus = colliderOf(shapes::torus(0.5f, 0.15f)),
                   knot = colliderOf(shapes::torusKnot(2, 3, 0.5f, 0.1f));
    DistanceStart start;
    Pose pose = randomPose(random, 1);
    pose.position.x = 1.5f;
    for (int i = 0; i < 300; ++i) {
        CAPTURE(i);
        pose.position += random.point(0.02);
        pose.rotation = glm::normalize(glm::angleAxis(0.03f, random.direction()) * pose.rotation);
        const Placed a{torus}, b{knot, pose};
        const BodyDistance warm = distance(a, b, {}, &start), cold = distance(a, b);
        CHECK(warm.overlap == cold.overlap);
        if (warm.overlap != Overlap::none) continue;
        CHECK(double(warm.distance) == Approx(double(cold.distance)).margin(exactness));
        CHECK(start.triangleA == warm.a.triangle);
        CHECK(start.triangleB == warm.b.triangle);
    }
}

TEST_CASE("Swapped bodies are as far apart, with the opposite normal") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const Collider torus = colliderOf(shapes::torus(0.5f, 0.15f)), cone = colliderOf(shapes::cone(0.4f, 1, 24));
    for (int i = 0; i < 200; ++i) {
        CAPTURE(i);
        const Placed a{torus, randomPose(random, 1)}, b{cone, randomPose(random, 1), 0.7f};
        const BodyDistance one = distance(a, b), other = distance(b, a);
        CHECK((one.overlap == Overlap::aInsideB) == (other.overlap == Overlap::bInsideA));
        CHECK((one.overlap == Overlap::surfaces) == (other.overlap == Overlap::surfaces));
        CHECK(double(one.distance) == Approx(double(other.distance)).margin(1e-5));
        if (one.overlap == Overlap::none && one.distance > 1e-3f) CHECK(glm::dot(one.normal, other.normal) < 1e-2f);
    }
}

TEST_CASE("A limit ends the search for bodies that are farther apart") {
    const Collider box = colliderOf(shapes::box(glm::vec3(0.5f)));
    const Placed a{box}, b{box, {{3, 0, 0}}};
    CHECK(distance(a, b).distance == Approx(2));
    CHECK(distance(a, b, {.maxDistance = 2.001f}).distance == Approx(2));
    CHECK_FALSE(distance(a, b, {.maxDistance = 1.999f}).found);
    CHECK_FALSE(distance(a, b, {.maxDistance = 0}).found);
    CHECK_FALSE(distance(a, b, {.maxDistance = -1}).found);
    CHECK_FALSE(distance(a, b, {.maxDistance = NAN}).found);
    const Placed far{box, {{3e9f, 0, 0}}};
    CHECK(distance(a, far).distance == Approx(3e9));
}

TEST_CASE("A limit of zero finds bodies that overlap or touch") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const Collider torus = colliderOf(shapes::torus(0.5f, 0.15f)), box = colliderOf(shapes::box(glm::vec3(0.5f)));
    int overlaps = 0;
    for (int i = 0; i < 200; ++i) {
        CAPTURE(i);
        const Placed a{torus, randomPose(random, 0.7)}, b{box, randomPose(random, 0.7), 0.8f};
        const BodyDistance unlimited = distance(a, b), limited = distance(a, b, {.maxDistance = 0});
        CHECK(limited.found == (unlimited.overlap != Overlap::none));
        CHECK(limited.overlap == unlimited.overlap);
        if (limited.found) CHECK(limited.distance == unlimited.distance);
        overlaps += limited.found;
    }
    CHECK(overlaps > 50);
    CHECK(overlaps < 150);
    const Placed a{box}, touching{box, {{1, 0, 0}}};
    CHECK(distance(a, touching, {.maxDistance = 0}).found);
    CHECK(distance(a, Placed{box, {{1.5f, 0, 0}}}, {.maxDistance = 0.5f}).found);
    CHECK_FALSE(distance(a, Placed{box, {{1.0001f, 0, 0}}}, {.maxDistance = 0}).found);
}

TEST_CASE("A body inside another is distinguished from one that is apart") {
    const Collider ball = colliderOf(shapes::sphere(0.2f, 3)), large = colliderOf(shapes::sphere(1, 4)),
                   shell = colliderOf(shapes::join({shapes::sphere(1, 4), shapes::flipped(shapes::sphere(0.8f, 4))})),
                   pair = colliderOf(shapes::join({shapes::moved(shapes::sphere(0.1f, 3), {0, 0, 0.2f}),
                                                   shapes::moved(shapes::sphere(0.1f, 3), {0, 0, 3})}));
    const Placed inner{ball, {{0.3f, 0, 0}}}, outer{large};
    const BodyDistance inside = distance(inner, outer), swapped = distance(outer, inner);
    CHECK(inside.overlap == Overlap::aInsideB);
    CHECK(swapped.overlap == Overlap::bInsideA);
    // the deepest point of a ball of radius 0.2 at 0.3 is the one nearest to the centre of the large one
    CHECK(inside.distance == Approx(-0.9).margin(0.02));
    CHECK(swapped.distance == Approx(-0.9).margin(0.02));
    CHECK(distance(inner, Placed{shell}).overlap == Overlap::none);
    CHECK(distance(inner, Placed{shell}).distance == Approx(0.3).margin(0.01));
    // one of two components
    CHECK(distance(Placed{pair}, outer).overlap == Overlap::aInsideB);
    CHECK(distance(outer, Placed{pair}).overlap == Overlap::bInsideA);
}

TEST_CASE("Overlapping bodies have the depth of the deepest point") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const float h = 1.0f / 48;
    const Collider ball = colliderOf(shapes::sphere(0.5f, 5)), block = colliderOf(shapes::box(glm::vec3(0.5f)));
    for (int i = 0; i < 100; ++i) {
        CAPTURE(i);
        // a ball on a face of the block, and the same turned together; its deepest point is nearer to that face than
        // to any other
        const float depth = float(random(0.01, 0.4)), aside = 0.45f - depth;
        const Pose frame = randomPose(random, 1);
        const glm::vec3 at(float(random(-aside, aside)), float(random(-aside, aside)), 1 - depth);
        const Placed a{ball, {frame.toWorld(at), frame.rotation}}, b{block, frame};
        const BodyDistance answer = distance(a, b);
        CHECK(answer.overlap == Overlap::surfaces);
        CHECK(answer.distance == Approx(-depth).margin(0.1 * double(h)));
        CHECK(glm::dot(answer.normal, frame.rotation * glm::vec3(0, 0, 1)) > 0.99f);
        // moving the ball out by the depth leaves no overlap but that of the facets
        const Placed out{ball, {a.pose.position - answer.distance * answer.normal, a.pose.rotation}};
        CHECK(distance(out, b).distance > -0.1f * h);
    }
}

TEST_CASE("A body without its mesh is as far apart as the field's zero set") {
    const Mesh mesh = shapes::torus(0.5f, 0.15f);
    const LevelSet levelSet = build(mesh, {.voxelSize = 0.02f});
    const Collider bare(withBody(levelSet, mesh, {}, false)), full(mesh, levelSet);
    const Placed other{full, {{2, 0.1f, 0.3f}}};
    CHECK(distance(Placed{bare}, other).distance ==
          Approx(double(distance(Placed{full}, other).distance)).margin(0.002));
}

TEST_CASE("Fine meshes at a small distance are as far apart as their triangles") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const Mesh mesh = shapes::carvedBox(6000, 0.4f);
    const Collider body = colliderOf(mesh, 64);
    int separated = 0;
    for (int i = 0; i < 10; ++i) {
        CAPTURE(i);
        const Placed a{body, randomPose(random, 0.1)};
        Placed b{body, randomPose(random, 0.1)};
        b.pose.position += 3.f * random.direction();
        for (int k = 0; k < 8; ++k) {
            const BodyDistance here = distance(a, b);
            b.pose.position -= (0.1f - here.distance) * here.normal;
        }
        separated += checkSeparated(a, b);
    }
    CHECK(separated > 4);
}
}  // namespace bilayer::distance_test
