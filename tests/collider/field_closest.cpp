// SPDX-License-Identifier: Apache-2.0
// Closest points against brute force over all triangles in double precision.
#include <oneapi/tbb/parallel_for.h>

#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <glm/gtc/constants.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <limits>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include <bilayer/collider/field.h>
#include <bilayer/sdf/build.h>
#include <bilayer/sdf/mesh_io.h>
#include "collider/field/triangles/triangle_tests.h"
#include "demos/shared/shapes.h"
#include "tests/collider/query_points.h"
#include "tests/support/random.h"
#include "tests/support/support.h"
#include "tests/support/truth.h"

namespace bilayer::field_closest_test {
using namespace bilayer::detail;
using namespace bilayer::test;

namespace {

constexpr float infinity = std::numeric_limits<float>::infinity();
constexpr double tolerance = 1e-5;      // of distances up to ten voxels away [voxels]
constexpr double farTolerance = 1e-6;   // relative, of distances farther away
constexpr double interpolantOff = 0.1;  // maximum interpolation error of the torus below [voxels]
constexpr double samePlace = 1e-4;      // triangles within this distance of a closest point share it [voxels]

glm::dvec3 normalOf(const TriangleCorners& c) {
    return glm::normalize(glm::cross(c[1] - c[0], c[2] - c[0]));
}

double distanceToSegment(const glm::dvec3& p, const glm::dvec3& a, const glm::dvec3& b) {
    return std::sqrt(squaredDistance(p, a, b, b));
}

// The normal at a point of the surface: the mean of the normals of all triangles that share it, weighted by their
// angles there.
glm::dvec3 normalAt(const Mesh& mesh, const glm::dvec3& place, double room) {
    glm::dvec3 sum(0);
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
        const TriangleCorners c = cornersOf(mesh, i);
        if (squaredDistance(place, c[0], c[1], c[2]) > room * room) continue;
        double angle = glm::two_pi<double>();
        for (std::size_t k = 0; k < 3; ++k)
            if (distanceToSegment(place, c[k], c[(k + 1) % 3]) < room) angle = glm::pi<double>();
        for (std::size_t k = 0; k < 3; ++k)
            if (glm::distance(place, c[k]) < room)
                angle =
                    std::acos(glm::dot(glm::normalize(c[(k + 1) % 3] - c[k]), glm::normalize(c[(k + 2) % 3] - c[k])));
        sum += angle * normalOf(c);
    }
    return glm::normalize(sum);
}

// Whether a point on a triangle lies on the claimed feature, and on no smaller one.
bool isFeature(const TriangleCorners& c, const glm::dvec3& place, const ClosestPoint& claimed, double room) {
    std::array<bool, 3> onEdge, onCorner;
    for (std::size_t k = 0; k < 3; ++k) {
        onEdge[k] = distanceToSegment(place, c[k], c[(k + 1) % 3]) < room;
        onCorner[k] = glm::distance(place, c[k]) < room;
    }
    const auto count = [](const std::array<bool, 3>& on) { return on[0] + on[1] + on[2]; };
    switch (claimed.feature) {
        case Feature::face:
            return true;  // a point near an edge may still be on the face
        case Feature::edge:
            return onEdge[claimed.index];
        case Feature::vertex:
            return onCorner[claimed.index] && count(onCorner) == 1;
    }
    return false;
}

// Whether the feature at a point is unambiguous. On the claimed feature the point must be far from others. No triangle
// there may be near it with two of its edges, as needles are over a long stretch from their tips.
bool isClear(const Mesh& mesh, const TriangleCorners& own, const glm::dvec3& place, const ClosestPoint& claimed,
             double room) {
    if (claimed.feature == Feature::vertex) return true;
    for (std::size_t k = 0; k < 3; ++k) {
        if (glm::distance(place, own[k]) < 2 * room) return false;
        const bool on = claimed.feature == Feature::edge && k == claimed.index;
        if (!on && distanceToSegment(place, own[k], own[(k + 1) % 3]) < 2 * room) return false;
    }
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
        const TriangleCorners c = cornersOf(mesh, i);
        int met = 0;
        for (std::size_t k = 0; k < 3; ++k) met += distanceToSegment(place, c[k], c[(k + 1) % 3]) < 2 * room;
        if (met > 1) return false;
    }
    return true;
}

struct Tally {
    double worst = 0, worstFar = 0;  // [voxels]; relative
    std::size_t points = 0, features = 0, wrongSigns = 0, wrongFeatures = 0, wrongNormals = 0, wrongPlaces = 0,
                wrongBatch = 0;
    std::array<std::size_t, 3> kinds{};
};

// The features and normals of the first `normals` points are checked too, which visits all triangles once more.
Tally check(const Mesh& mesh, float resolution, int count, int normals, unsigned seed) {
    const float voxelSize = voxelSizeFor(mesh, resolution);
    const double h = double(voxelSize), room = samePlace * h;
    const Field field(build(mesh, {.voxelSize = voxelSize}), mesh);
    const Truth truth(mesh);
    const std::vector<glm::vec3> points = pointsAround(mesh, h, count, seed);
    std::vector<ClosestPoint> batch(points.size());
    field.closest(points, batch);
    Tally tally;
    for (std::size_t i = 0; i < points.size(); ++i) {
        const glm::dvec3 p(points[i]);
        const ClosestPoint closest = field.closest(points[i]);
        tally.wrongBatch += !same(closest, batch[i]);
        CAPTURE(i, p.x, p.y, p.z);
        REQUIRE(closest.found);
        const double distance = truth.distance(p), off = std::abs(std::abs(double(closest.distance)) - distance);
        ++tally.points;
        double& worst = distance < 10 * h ? tally.worst : tally.worstFar;
        worst = std::max(worst, distance < 10 * h ? off / h : off / distance);
        tally.wrongSigns += distance > room && (closest.distance < 0) != (truth.winding(p) > 0);
        const glm::dvec3 place(closest.position);
        const TriangleCorners c = cornersOf(mesh, closest.triangle);
        const double rounding = 1e-7 * (glm::length(place) + distance);
        tally.wrongPlaces += std::abs(glm::distance(p, place) - distance) > tolerance * h + 8 * rounding ||
                             std::sqrt(squaredDistance(place, c[0], c[1], c[2])) > rounding;
        ++tally.kinds[std::size_t(closest.feature)];
        if (distance > 10 * h) continue;
        tally.wrongFeatures += !isFeature(c, place, closest, room);
        if (int(tally.features) == normals || !isClear(mesh, c, place, closest, room)) continue;
        const glm::dvec3 normal = normalAt(mesh, place, room);
        if (!(glm::distance(normal, normalAt(mesh, place, room / 8)) < 1e-6)) continue;  // others are almost as near
        ++tally.features;
        tally.wrongNormals += !(glm::distance(glm::dvec3(closest.normal), normal) < 1e-3);
    }
    return tally;
}

void require(const std::string& name, const Tally& tally) {
    INFO(name << ": " << tally.points << " points, worst " << tally.worst << " voxels, far " << tally.worstFar
              << ", faces, edges, vertices " << tally.kinds[0] << " " << tally.kinds[1] << " " << tally.kinds[2]);
    CHECK(tally.worst < tolerance);
    CHECK(tally.worstFar < farTolerance);
    CHECK(tally.wrongSigns == 0);
    CHECK(tally.wrongFeatures == 0);
    CHECK(tally.wrongNormals == 0);
    CHECK(tally.wrongPlaces == 0);
    CHECK(tally.wrongBatch == 0);
    CHECK(tally.features > 100);
}

}  // namespace

TEST_CASE("the closest points of generated shapes are those of all triangles") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    const struct {
        const char* name;
        Mesh mesh;
        float resolution;
    } cases[] = {
        {"a box with triangles larger than blocks", tilted(shapes::box({1, 0.8f, 0.6f})), 90},
        {"a box along the axes", shapes::box({1, 0.8f, 0.6f}), 30},
        {"a torus", tilted(shapes::torus(1, 0.3f, 48, 24)), 40},
        {"a sphere with triangles much smaller than voxels", shapes::sphere(1, 4), 10},
        {"a needle", tilted(shapes::cone(0.01f, 2, 24)), 60},
        {"a wall thinner than a voxel", tilted(shapes::box({1, 1, 0.003f}, 3)), 50},
        {"a knot", shapes::torusKnot(2, 3, 1, 0.2f, 120, 12), 50},
        {"so few triangles that all of them are near", shapes::box({0.3f, 0.2f, 0.1f}, 2), 28},
    };
    for (const auto& one : cases) require(one.name, check(one.mesh, one.resolution, 4000, 1000, seed));
}

TEST_CASE("the closest points of clean public meshes are those of all triangles") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    for (const char* name : {"fandisk.obj", "spot.obj", "screwdriver_7k.off", "rocker-arm.obj", "bunny_watertight.obj"})
        if (const auto path = corpusMesh(name)) require(name, check(readMesh(*path), 100, 4000, 300, seed));
}

TEST_CASE("closest points need a place, a distance that is not exceeded, and the right mesh") {
    const Mesh sphere = shapes::sphere(1, 4);
    const LevelSet levelSet = build(sphere, {.voxelSize = 0.05f});
    const Field field(levelSet, sphere);
    const float nan = std::numeric_limits<float>::quiet_NaN();
    for (const glm::vec3& p : {glm::vec3(nan, 0, 0), glm::vec3(0, infinity, 0), glm::vec3(0, 0, -infinity)}) {
        ClosestPoint batch;
        field.closest(std::span(&p, 1), std::span(&batch, 1));
        CHECK_FALSE(field.closest(p).found);
        CHECK_FALSE(batch.found);
    }
    Random random(test::seed());
    for (int i = 0; i < 1000; ++i) {
        const double radius = i % 2 ? random(0.2, 3) : 1 + 0.05 * std::pow(10, random(-6, 0));
        const glm::vec3 p(radius * glm::dvec3(random.direction()));
        const ClosestPoint all = field.closest(p);
        REQUIRE(all.found);
        const float way = std::abs(all.distance);
        CHECK(same(field.closest(p, 1.001f * way), all));
        CHECK(same(field.closest(p, std::nextafter(way, infinity)), all));
        CHECK_FALSE(field.closest(p, 0.999f * way).found);
    }
    CHECK_FALSE(field.closest({2, 0, 0}, -1).found);
    CHECK_FALSE(field.closest({2, 0, 0}, nan).found);
    CHECK_THROWS_AS(Field(levelSet, shapes::sphere(1, 3)), std::invalid_argument);
    ClosestPoint one;
    CHECK_THROWS_AS(field.closest(std::vector<glm::vec3>(2), std::span(&one, 1)), std::invalid_argument);
}

TEST_CASE("at the edges of a self-intersecting mesh closest points are on the right side") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    const float voxel = 0.05f;
    const Mesh mesh = tilted(shapes::join({shapes::box({1, 0.8f, 0.6f}), shapes::box({0.2f, 0.2f, 1.5f})}));
    const LevelSet levelSet = build(mesh, {.voxelSize = voxel});
    CHECK(levelSet.sign() == "winding");
    const Field field(levelSet, mesh);
    const Truth truth(mesh);
    Random random(seed);
    int near = 0, wrong = 0;
    for (int i = 0; i < 20000; ++i) {
        // around an edge of the box that the bar does not reach
        const glm::vec3 local(random(-0.9, 0.9), 0.8 + random(-0.02, 0.02), 0.6 + random(-0.02, 0.02));
        const glm::vec3 place = tilted(Mesh{{local}, {}}).points[0];
        const ClosestPoint closest = field.closest(place);
        if (std::abs(closest.distance) < samePlace * voxel) continue;
        ++near;
        wrong += (closest.distance < 0) != (truth.winding(glm::dvec3(place)) > 0);
    }
    CHECK(near > 15000);
    CHECK(wrong == 0);
}

TEST_CASE("closest points of meshes that build() has to repair are those of their triangles, with the field's signs") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    const Mesh torus = tilted(shapes::torus(1, 0.3f, 48, 24));
    Mesh turned = torus, twice = torus, flat = torus;
    for (std::size_t i = 0; i < turned.triangles.size(); i += 3)
        std::swap(turned.triangles[i].x, turned.triangles[i].y);
    twice.triangles.insert(twice.triangles.end(), torus.triangles.begin(), torus.triangles.begin() + 500);
    for (std::size_t i = 0; i < 100; ++i) {
        const glm::uvec3 t = torus.triangles[7 * i];
        flat.triangles.push_back({t.x, t.y, t.x});
        flat.triangles.push_back({t.y, t.y, t.y});
    }
    const struct {
        const char* name;
        Mesh mesh;
        Sign sign;
        bool byNormals;  // else the field's interpolant determines the side
    } cases[] = {{"every third triangle turned", turned, Sign::automatic, true},
                 {"triangles twice", twice, Sign::automatic, false},
                 {"triangles without area", flat, Sign::automatic, true},
                 {"winding", torus, Sign::winding, false},
                 {"flood", torus, Sign::flood, false}};
    const Truth truth(torus);
    for (const auto& one : cases) {
        const Field field(build(one.mesh, {.voxelSize = 0.05f, .sign = one.sign}), one.mesh);
        double worst = 0;
        int wrongSigns = 0, wrongNormals = 0;
        for (const glm::vec3& p : pointsAround(torus, 0.05, 2000, seed)) {
            const ClosestPoint closest = field.closest(p);
            REQUIRE(closest.found);
            const double distance = truth.distance(glm::dvec3(p));
            if (distance > 0.5) continue;
            worst = std::max(worst, std::abs(std::abs(double(closest.distance)) - distance) / 0.05);
            const double unsure = one.byNormals ? samePlace : interpolantOff;
            if (distance < unsure * 0.05) continue;
            wrongSigns += (closest.distance < 0) != (truth.winding(glm::dvec3(p)) > 0);
            // outward: away from the surface outside, towards it inside
            wrongNormals += glm::dot(closest.normal, p - closest.position) * closest.distance < 0;
        }
        INFO(one.name);
        CHECK(worst < tolerance);
        CHECK(wrongSigns == 0);
        CHECK(wrongNormals == 0);
    }
}

TEST_CASE("a point on an edge or a vertex has that feature, and its pseudonormal") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const glm::mat4 away = glm::translate(glm::mat4(1), glm::vec3(40, -70, 90));
    for (const Mesh& mesh :
         {shapes::box({1, 0.8f, 0.6f}), shapes::box({1, 0.8f, 0.6f}, 3), tilted(shapes::torus(1, 0.3f, 24, 12)),
          shapes::cone(0.5f, 2, 7), transformed(tilted(shapes::box({1, 0.5f, 0.7f}, 2)), away)}) {
        const float voxelSize = voxelSizeFor(mesh, 40);
        const Field field(build(mesh, {.voxelSize = voxelSize}), mesh);
        const double room = samePlace * double(voxelSize);
        std::size_t wrongFeatures = 0, wrongNormals = 0, wrongBatch = 0;
        const auto ask = [&](const glm::vec3& place, Feature feature) {
            const ClosestPoint closest = field.closest(place);
            ClosestPoint batch;
            field.closest(std::span(&place, 1), std::span(&batch, 1));
            wrongBatch += !same(closest, batch);
            wrongFeatures += closest.feature != feature || !isFeature(cornersOf(mesh, closest.triangle),
                                                                      glm::dvec3(closest.position), closest, 10 * room);
            wrongNormals +=
                !(glm::distance(glm::dvec3(closest.normal), normalAt(mesh, glm::dvec3(place), 10 * room)) < 1e-3);
        };
        for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
            const TriangleCorners c = cornersOf(mesh, i);
            for (std::size_t k = 0; k < 3; ++k) {
                ask(glm::vec3(c[k]), Feature::vertex);
                ask(glm::vec3(glm::mix(c[k], c[(k + 1) % 3], random(0.1, 0.9))), Feature::edge);
            }
            ask(glm::vec3((c[0] + c[1] + c[2]) / 3.0), Feature::face);
        }
        CAPTURE(mesh.triangles.size(), voxelSize);
        CHECK(wrongFeatures == 0);
        CHECK(wrongNormals == 0);
        CHECK(wrongBatch == 0);
    }
}
}  // namespace bilayer::field_closest_test
