// SPDX-License-Identifier: Apache-2.0
// Rays, spheres and nearest points of fields without meshes: the zero set of the interpolant.
#include <oneapi/tbb/parallel_for.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <span>
#include <vector>

#include <bilayer/collider/field.h>
#include "collider/field/zero/zero_queries.h"
#include "collider/field/zero/zero_search.h"
#include "demos/shared/shapes.h"
#include "sdf/base/access.h"
#include "tests/support/analytic.h"
#include "tests/support/random.h"
#include "tests/support/sampling.h"
#include "tests/support/support.h"

namespace bilayer::zero_set_test {
using namespace bilayer::detail;
using namespace bilayer::test;

namespace {

constexpr double h = 0.02;  // of most fields here [m]
constexpr float infinity = std::numeric_limits<float>::infinity();
constexpr float notANumber = std::numeric_limits<float>::quiet_NaN();

// A hollow ball: the cavity's radius and the thickness of its wall [voxels].
Solid hollowBall(double radius, double wall, const glm::dvec3& centre) {
    return {[=](const glm::dvec3& p) {
                const double away = glm::distance(p, centre) / h;
                return h * std::max(away - radius - wall, radius - away);
            },
            glm::dvec3(h * (radius + wall)), centre};
}

// Points of the surface around a place, by rays [m].
std::vector<glm::dvec3> surfaceAround(const Field& field, const glm::vec3& from, int count, Random& random) {
    std::vector<glm::dvec3> points;
    for (int i = 0; i < count; ++i) {
        const glm::vec3 along = random.direction();
        const auto hit = field.raycast({from, along});
        REQUIRE(hit);
        points.push_back(glm::dvec3(from) + double(hit->distance) * glm::normalize(glm::dvec3(along)));
    }
    return points;
}

// How far a sphere goes before it touches one of the points.
double firstTouch(const Ray& ray, double radius, std::span<const glm::dvec3> points) {
    const glm::dvec3 from(ray.origin), direction = glm::normalize(glm::dvec3(ray.direction));
    double first = std::numeric_limits<double>::infinity();
    for (const glm::dvec3& point : points) {
        const double along = glm::dot(point - from, direction);
        const double half2 = radius * radius - glm::dot(point - from, point - from) + along * along;
        if (half2 >= 0 && along > 0) first = std::min(first, along - std::sqrt(half2));
    }
    return first;
}

// A query with a count of the bounds that its search computes.
template <class Query>
struct Counted : Query {
    mutable std::size_t bounds = 0;

    using Query::Query;

    template <class... Arguments>
    double bound(const Arguments&... arguments) const {
        ++bounds;
        return Query::bound(arguments...);
    }
};

}  // namespace

TEST_CASE("the nearest zero is found in time where all of the surface is equally near") {
    const FieldOptions options{GENERATE(Storage::float32, Storage::fixed16)};
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (const double voxels : {16., 40., 100.}) {  // radius
        const glm::dvec3 centre = h * glm::dvec3(random.point(1));
        const Field field(levelSetOf(sphereSolid(voxels * h, centre), h), options);
        const double cells = 1.5 * 4 * 3.14159 * voxels * voxels;  // that contain surface
        for (const double off : {0., 1e-5, 1e-3, 0.03, 1., 0.9 * voxels}) {
            const glm::vec3 point(centre + off * h * glm::dvec3(random.direction()));
            Counted<NearestQuery> nearest(dataOf(field).toLocal(point), std::numeric_limits<double>::infinity());
            ZeroSearch(dataOf(field), nearest).run();
            const double truth = voxels - glm::distance(glm::dvec3(point), centre) / h;
            CAPTURE(voxels, off, nearest.bounds, cells);
            CHECK(double(nearest.bounds) < 10 * cells + 2e5);
            // the interpolant of a convex surface lies on one side of it, by 3/8 of its curvature at most
            CHECK(nearest.best == Approx(truth).margin(0.02 + 0.4 / voxels));
            const ClosestPoint closest = field.closest(point);
            REQUIRE(closest.found);
            CHECK(double(closest.distance) / h == Approx(-truth).margin(0.02 + 0.4 / voxels));
            CHECK(std::abs(field.distance(closest.position)) < 2e-3 * h);
        }
    }
}

TEST_CASE("spheres that fit their cavity are cast and tested in time") {
    const FieldOptions options{GENERATE(Storage::float32, Storage::fixed16)};
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (const double voxels : {16., 40., 100.}) {  // the cavity's radius
        const glm::vec3 centre(float(h) * random.point(1));
        const Field field(levelSetOf(hollowBall(voxels, 5, glm::dvec3(centre)), h), options);
        const double cells = 1.5 * 4 * 3.14159 * voxels * voxels;  // that contain the cavity's surface
        const std::vector<glm::dvec3> points = surfaceAround(field, centre, 20000, random);
        double nearest = voxels;
        for (const glm::dvec3& point : points)
            nearest = std::min(nearest, glm::distance(point, glm::dvec3(centre)) / h);
        for (const double room : {1e-6, 1e-5, 1e-4, 3e-4, 1e-3, 3e-3, 0.01, 0.1, 1e-3 * voxels}) {
            const double reach = nearest - room;
            const auto radius = float(reach * h);
            const Ray ray{centre, random.direction()};
            const glm::dvec3 from = dataOf(field).toLocal(centre), along = glm::normalize(glm::dvec3(ray.direction));
            Counted<AnyNearQuery> any(from, reach);
            ZeroSearch(dataOf(field), any).run();
            Counted<NearestQuery> within(from, reach);
            ZeroSearch(dataOf(field), within).run();
            Counted<SphereCastQuery> cast({from, along, 1e6}, reach);
            ZeroSearch(dataOf(field), cast).run();
            CAPTURE(voxels, room, cells, any.bounds, within.bounds, cast.bounds);
            for (const std::size_t bounds : {any.bounds, within.bounds, cast.bounds})
                CHECK(double(bounds) < 10 * cells + 2e5);
            // the nearest of so many points is this much farther away than the nearest zero at most
            constexpr double spacing = 2e-3, tolerance = 1.1e-3;
            CHECK(field.overlapsSphere(centre, float((nearest + tolerance) * h)));
            if (room > spacing + tolerance) CHECK_FALSE(field.overlapsSphere(centre, radius));
            const auto hit = field.sphereCast(ray, radius);
            REQUIRE(hit);
            const double truth = firstTouch(ray, double(radius), points) / h;
            CHECK(double(hit->distance) / h < truth + tolerance);
            CHECK(double(hit->distance) / h > truth - spacing - tolerance);
        }
    }
}

TEST_CASE("rays hit a sphere and a box at the analytic distance") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (const Solid& solid : {sphereSolid(0.4), boxSolid({0.35, 0.22, 0.3})}) {
        const Field field(levelSetOf(solid, h));
        int hits = 0, misses = 0;
        for (int i = 0; i < 4000; ++i) {
            const glm::vec3 origin = float(random(0.8, 5)) * random.direction();
            const glm::vec3 towards = glm::normalize(random.point(0.6) - origin);
            CAPTURE(origin.x, origin.y, origin.z, towards.x, towards.y, towards.z);
            // the truth by tiny steps of the formula's own distance, in double precision
            const glm::dvec3 from(origin), along = glm::normalize(glm::dvec3(towards));
            double t = 0, nearest = 1e9;
            for (int step = 0; step < 2000 && t < 12 && nearest > 1e-9; ++step) {
                const double distance = solid.distance(from + t * along);
                nearest = std::min(nearest, distance);
                t += distance;
            }
            const auto hit = field.raycast({origin, towards, 100});
            if (nearest > 0.3 * h) {
                ++misses;
                REQUIRE_FALSE(hit);
                continue;
            }
            if (nearest > 1e-6) continue;  // grazes the surface by less than the interpolation error
            const glm::dvec3 p = from + t * along;
            if (solid.distance(p + h * along) > -0.5 * h) continue;  // cuts an edge that the interpolant rounds off
            ++hits;
            REQUIRE(hit);
            REQUIRE(std::abs(field.distance(hit->position)) < 2e-4 * h);
            // if a corner of the box lies in the middle of a cell, the interpolation error is half a voxel
            REQUIRE(std::abs(solid.distance(glm::dvec3(hit->position))) < 0.5 * h);
            REQUIRE(std::abs(hit->distance - t) < 2 * h);
            REQUIRE(glm::distance(origin + hit->distance * towards, hit->position) < 1e-5f);
            REQUIRE(glm::length(hit->normal) == Approx(1).margin(1e-5));
            REQUIRE(glm::dot(hit->normal, towards) < 0.2f);
        }
        REQUIRE(hits > 500);
        REQUIRE(misses > 200);
    }
}

TEST_CASE("rays hit the interpolant where steps of a fiftieth of a voxel do") {
    const FieldOptions options{GENERATE(Storage::float32, Storage::fixed16)};
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (const Solid& solid : smallSolids()) {
        const Field field(levelSetOf(solid, h), options);
        for (int i = 0; i < 1000; ++i) {
            const glm::vec3 origin = random.direction();
            const glm::vec3 towards = glm::normalize(random.point(0.5) - origin);
            const double step = 0.02 * h;
            double first = 0;  // distance at which it is certainly inside
            while (first < 2 && field.distance(origin + float(first) * towards) > -1e-5 * h) first += step;
            const auto hit = field.raycast({origin, towards, 2});
            CAPTURE(origin.x, origin.y, origin.z, towards.x, towards.y, towards.z, first);
            if (hit) REQUIRE(std::abs(field.distance(hit->position)) < 2e-5 * h);
            if (first >= 2) continue;
            REQUIRE(hit);
            REQUIRE(hit->distance <= first + 2e-5 * h);
        }
    }
}

TEST_CASE("rays straight at flat and round walls are exact") {
    const Field box(levelSetOf(boxSolid({0.35, 0.22, 0.3}), h));
    const auto hit = box.raycast({{2, 0.05f, -0.07f}, {-1, 0, 0}, infinity});
    REQUIRE(hit);
    REQUIRE(hit->distance == Approx(1.65).margin(2e-4 * h));
    REQUIRE(hit->normal.x == Approx(1).margin(1e-5));

    const Field sphere(levelSetOf(sphereSolid(0.4), h));
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (int i = 0; i < 500; ++i) {
        const glm::vec3 out = random.direction();
        const auto round = sphere.raycast({3.f * out, -out, 10});
        REQUIRE(round);
        REQUIRE(round->distance == Approx(2.6).margin(0.02 * h));
        REQUIRE(glm::dot(round->normal, out) > 0.999f);
    }
}

TEST_CASE("a ray does not pass a wall of one voxel") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (int i = 0; i < 20; ++i) {
        const double offset = random(-0.5, 0.5) * h;
        const Solid slab{[=](const glm::dvec3& p) {
                             return boxSolid({0.4, 0.4, 0.55 * h}).distance(p - glm::dvec3(0, 0, offset));
                         },
                         {0.4, 0.4, 2 * h}};
        const Field field(levelSetOf(slab, h));
        for (int k = 0; k < 200; ++k) {
            const glm::vec3 target(float(random(-0.3, 0.3)), float(random(-0.3, 0.3)), float(offset));
            glm::vec3 towards = random.direction();
            if (std::abs(towards.z) < 0.2f) towards.z = 0.2f;
            towards = glm::normalize(towards);
            const auto hit = field.raycast({target - 0.9f * towards, towards, 10});
            CAPTURE(offset, target.x, target.y, towards.x, towards.y, towards.z);
            REQUIRE(hit);
            REQUIRE(glm::distance(hit->position, target) < 5 * h);
        }
    }
}

TEST_CASE("without the mesh: rays that start inside, end early or are invalid") {
    const Field field(levelSetOf(sphereSolid(0.4), h));
    for (const glm::vec3 start : {glm::vec3(0), glm::vec3(0.39f, 0, 0)}) {
        const auto hit = field.raycast({start, {1, 0, 0}, 10});
        REQUIRE(hit);
        REQUIRE(hit->distance == 0);
        REQUIRE(hit->position == start);
        REQUIRE(glm::length(hit->normal) == Approx(1));
    }
    REQUIRE(field.raycast({{1, 0, 0}, {-1, 0, 0}, 0.61f}));
    REQUIRE_FALSE(field.raycast({{1, 0, 0}, {-1, 0, 0}, 0.59f}));
    REQUIRE_FALSE(field.raycast({{1, 0, 0}, {1, 0, 0}, infinity}));
    REQUIRE(field.raycast({{1, 0, 0}, {-5, 0, 0}, 1})->distance == Approx(0.6).margin(1e-4));

    REQUIRE_FALSE(field.raycast({{1, 0, 0}, {0, 0, 0}, infinity}));
    REQUIRE_FALSE(field.raycast({{notANumber, 0, 0}, {1, 0, 0}, 10}));
    REQUIRE_FALSE(field.raycast({{1, 0, 0}, {notANumber, 0, 0}, 10}));
    REQUIRE_FALSE(field.raycast({{infinity, 0, 0}, {-1, 0, 0}, infinity}));
    REQUIRE_FALSE(field.raycast({{1, 0, 0}, {-1, 0, 0}, notANumber}));
    REQUIRE_FALSE(field.raycast({{1, 0, 0}, {-1, 0, 0}, -1}));
    // from so far that single precision cannot determine a hit: the cast must only terminate
    (void)field.raycast({{1e30f, 1e30f, 1e30f}, {-1, -1, -1}, infinity});
    (void)field.raycast({{3e38f, 0, 0}, {-1, 0, 0}, infinity});
    // along the surface all the way
    (void)field.raycast({{0.4f, -3, 0}, {0, 1, 0}, infinity});
}

TEST_CASE("without the mesh no chord is too short for a ray") {
    const FieldOptions options{GENERATE(Storage::float32, Storage::fixed16)};
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const Field field(levelSetOf(sphereSolid(0.4), h), options);
    int shortOnes = 0, misses = 0;
    for (int i = 0; i < 1000; ++i) {
        // grazes the surface, to within 1e-4 voxels
        const glm::dvec3 out(random.direction());
        const glm::dvec3 along = glm::normalize(glm::cross(out, glm::dvec3(random.direction())));
        Ray ray{glm::vec3(0.4 * out - 0.2 * along), glm::vec3(along), 1};
        const glm::dvec3 way = glm::normalize(glm::dvec3(ray.direction));
        double first = -1, last = -1, lowest = 1;
        const auto probe = [&] {
            first = last = -1, lowest = 1;
            for (double t = 0.2 - 2 * h; t < 0.2 + 2 * h; t += 2e-4 * h) {
                const double distance = field.distance(glm::vec3(glm::dvec3(ray.origin) + t * way));
                lowest = std::min(lowest, distance);
                if (distance >= 0) continue;
                if (first < 0) first = t;
                last = t;
            }
        };
        probe();
        ray.origin += glm::vec3((random(-1e-4, 1e-4) * h - lowest) * out);
        probe();
        const auto hit = field.raycast(ray);
        CAPTURE(i, lowest / h, first / h, last / h);
        if (lowest < -1e-5 * h) {
            REQUIRE(hit);
            shortOnes += last - first < 0.1 * h;
        }
        if (lowest > 2e-5 * h) {
            REQUIRE_FALSE(hit);
            ++misses;
        }
        if (hit) REQUIRE(std::abs(field.distance(hit->position)) < 2e-5 * h);
    }
    REQUIRE(shortOnes > 10);
    REQUIRE(misses > 100);
}

TEST_CASE("without the mesh rays far from the origin are as good as near it") {
    const glm::dvec3 centre(1e4, -1e4, 5e3);
    const auto hit = Field(levelSetOf(sphereSolid(0.3, centre), 0.01))
                         .raycast({glm::vec3(centre) + glm::vec3(2, 0, 0), {-1, 0, 0}, 10});
    REQUIRE(hit);
    REQUIRE(hit->distance == Approx(1.7).margin(2e-4));
}

TEST_CASE("without the mesh, spheres stop where they touch the interpolant's zeros") {
    const FieldOptions options{GENERATE(Storage::float32, Storage::fixed16)};
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (const Solid& solid : smallSolids()) {
        const Field field(levelSetOf(solid, h), options);
        int met = 0, missed = 0;
        for (int i = 0; i < 300; ++i) {
            const auto radius = float(h * std::pow(10, random(-1, 2)));
            const glm::vec3 origin = (1 + radius) * float(random(1, 3)) * random.direction();
            const glm::vec3 target = random.point(0.6 + radius);
            const auto hit = field.sphereCast({origin, target - origin, 100}, radius);
            const glm::dvec3 along = glm::normalize(glm::dvec3(target) - glm::dvec3(origin));
            const auto gapAt = [&](double t) {
                return double(field.closest(glm::vec3(glm::dvec3(origin) + t * along)).distance) - double(radius);
            };
            CAPTURE(i, radius / h);
            double t = 0, gap = 1;
            for (int k = 0; k < 300 && t < 12 && gap > 2e-3 * h; ++k) {
                gap = gapAt(t);
                t += std::max(gap, 1e-3 * h);
            }
            if (!hit) {
                ++missed;
                REQUIRE(gap > 0);
                continue;
            }
            ++met;
            REQUIRE(std::abs(gapAt(hit->distance)) < 2e-3 * h);
            for (int k = 0; k < 50; ++k) REQUIRE(gapAt(0.02 * k * double(hit->distance)) > -2e-3 * h);
            REQUIRE(std::abs(field.distance(hit->position)) < 2e-3 * h);
        }
        REQUIRE(met > 50);
        REQUIRE(missed > 20);
    }
}
}  // namespace bilayer::zero_set_test
