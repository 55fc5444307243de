// Ray casts, segment casts and sphere sweeps: with the mesh against brute force over all triangles in double precision,
// without it against the interpolant.
#include <oneapi/tbb/parallel_for.h>

#include <atomic>
#include <catch2/catch.hpp>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <memory>
#include <optional>
#include <vector>

#include <bilayer/collider/field.h>
#include <bilayer/sdf/build.h>
#include <bilayer/sdf/mesh_io.h>
#include "demos/shared/shapes.h"
#include "tests/support/analytic.h"
#include "tests/support/random.h"
#include "tests/support/sampling.h"
#include "tests/support/support.h"
#include "tests/support/truth.h"

using namespace bilayer;
using namespace bilayer::test;

namespace {

constexpr double h = 0.02;  // of most fields here [m]
constexpr float infinity = std::numeric_limits<float>::infinity();
constexpr float notANumber = std::numeric_limits<float>::quiet_NaN();

// A field with its mesh, and its ground truth.
struct Exact {
    Mesh mesh;
    Field field;
    Truth truth;
    double voxel;

    explicit Exact(const Mesh& of, int resolution = 48)
        : mesh(of),
          field(build(mesh, {.voxelSize = voxelSizeFor(mesh, resolution)}), mesh),
          truth(mesh),
          voxel(field.voxelSize()) {}
};

std::vector<Exact> exactFields() {
    std::vector<Exact> fields;
    fields.emplace_back(shapes::torusKnot(2, 3, 0.4f, 0.1f, 200, 16));
    fields.emplace_back(shapes::bowl(0.5f, 0.004f, 64));  // a wall of 0.2 voxels
    for (const char* name : {"bunny_watertight.obj", "fandisk.obj", "cgal-cheese.off"})
        if (const auto path = corpusMesh(name)) fields.emplace_back(readMesh(*path));
    return fields;
}

// Where a path first comes within a radius of the surface, by conservative advancement; none if it stays farther than
// the radius plus `room`. NaN if it comes nearer than that but not within the radius: then the answer is undefined.
std::optional<double> firstWithin(const Truth& truth, const glm::dvec3& from, const glm::dvec3& along, double length,
                                  double radius, double room) {
    double least = 1e30, t = 0;
    for (int i = 0; i < 100000 && t < length; ++i) {
        const double left = truth.distance(from + t * along) - radius;
        if (left < 1e-3 * room) return t;
        least = std::min(least, left);
        t += std::max(left, 1e-3 * room);
    }
    if (t < length || least < room) return std::numeric_limits<double>::quiet_NaN();
    return std::nullopt;
}

}  // namespace

TEST_CASE("with the mesh, rays meet its surface, and nothing before it") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (const Exact& exact : exactFields()) {
        const double scale = bounds(exact.mesh).longestSide(), room = 1e-4 * exact.voxel;
        const glm::dvec3 centre(bounds(exact.mesh).centre());
        std::vector<Ray> rays(1500);
        for (Ray& ray : rays) {
            const glm::dvec3 target = centre + glm::dvec3(random.point(0.5 * scale));
            ray.origin = glm::vec3(target + scale * random(0, 2) * glm::dvec3(random.direction()));
            ray.direction = glm::vec3(target - glm::dvec3(ray.origin)) * float(random(0.1, 10));
        }
        std::vector<std::optional<RayHit>> hits(rays.size());
        exact.field.raycast(rays, hits);
        std::atomic<int> met = 0, started = 0;
        std::vector<std::string> faults(rays.size());
        tbb::parallel_for(std::size_t(0), rays.size(), [&](std::size_t i) {
            const glm::dvec3 from(rays[i].origin), along = glm::normalize(glm::dvec3(rays[i].direction));
            const auto& hit = hits[i];
            const auto fail = [&](const char* what) { faults[i] = what; };
            const double start = exact.truth.signedDistance(from);
            if (std::abs(start) < room) return;
            if (start < 0) {
                ++started;
                if (!hit || hit->distance != 0 || hit->position != rays[i].origin) fail("starts inside");
                return;
            }
            const auto expected = firstWithin(exact.truth, from, along, 6 * scale, 0, room);
            if (expected && std::isnan(*expected)) return;
            if (bool(expected) != bool(hit)) return fail(expected ? "missed" : "met nothing");
            if (!hit) return;
            ++met;
            // at grazing angles the end of the reference is inexact
            const double off = std::abs(double(hit->distance) - *expected);
            if (exact.truth.distance(glm::dvec3(hit->position)) > 0.1 * room + 1e-6 * scale) fail("not on the surface");
            if (glm::distance(from + double(hit->distance) * along, glm::dvec3(hit->position)) > room + 1e-6 * scale)
                fail("not on the ray");
            if (off > room + 1e-6 * scale &&
                exact.truth.distance(from + (*expected + 0.5 * (hit->distance - *expected)) * along) > room)
                fail("not the first");
            if (glm::dot(glm::dvec3(hit->normal), along) > 1e-6) fail("normal along the ray");
            const glm::uvec3 t = exact.field.mesh()->triangles[hit->triangle];
            const auto& p = exact.field.mesh()->points;
            if (std::sqrt(squaredDistance(glm::dvec3(hit->position), p[t.x], p[t.y], p[t.z])) > room + 1e-6 * scale)
                fail("not on its triangle");
        });
        for (std::size_t i = 0; i < rays.size(); ++i) {
            CAPTURE(i, rays[i].origin.x, rays[i].origin.y, rays[i].origin.z, rays[i].direction.x, rays[i].direction.y,
                    rays[i].direction.z);
            REQUIRE(faults[i] == "");
        }
        REQUIRE(met > 100);
        if (exact.voxel < 1e-2 * scale) REQUIRE(started > 10);
    }
}

TEST_CASE("with the mesh, rays from very far, along axes and through voxel centres meet it") {
    const Exact box(shapes::box({0.5f, 0.25f, 0.125f}, 4), 64);
    const float far = 1e6f * box.field.voxelSize();
    for (const float y : {0.f, 0.0625f, -0.125f, 0.2f}) {
        const auto hit = box.field.raycast({{far, y, 0}, {-1, 0, 0}, infinity});
        REQUIRE(hit);
        REQUIRE(std::abs(hit->position.x - 0.5f) < 1e-7f);
        REQUIRE(hit->normal.x == Approx(1));
    }
    const float voxel = box.field.voxelSize();
    for (int i = -8; i <= 8; ++i)
        for (int j = -4; j <= 4; ++j) {
            const bool within = std::abs(float(i) * voxel) <= 0.25f && std::abs(float(j) * voxel) <= 0.125f;
            const auto hit = box.field.raycast({{-1, float(i) * voxel, float(j) * voxel}, {1, 0, 0}, infinity});
            REQUIRE(bool(hit) == within);
            if (hit) REQUIRE(hit->distance == Approx(0.5).margin(1e-6));
        }
    // in the plane of a face: the ray hits the adjacent faces at their edges
    const auto along = box.field.raycast({{-1, 0.1f, 0.125f}, {1, 0, 0}, infinity});
    REQUIRE(along);
    REQUIRE(along->distance == Approx(0.5).margin(1e-6));
    REQUIRE_FALSE(box.field.raycast({{-1, 0.1f, std::nextafter(0.125f, 1.f) + 1e-6f}, {1, 0, 0}, infinity}));
}

TEST_CASE("rays meet a sphere and a box where geometry says") {
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

TEST_CASE("rays meet the interpolant where steps of a fiftieth of a voxel do") {
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

TEST_CASE("without the mesh rays that start inside, end early or are no rays") {
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

TEST_CASE("with the mesh, spheres stop where they touch it") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (const Exact& exact : exactFields()) {
        const double scale = bounds(exact.mesh).longestSide(), room = 1e-4 * exact.voxel;
        const glm::dvec3 centre(bounds(exact.mesh).centre());
        std::vector<Ray> rays(400);
        std::vector<float> radii(rays.size());
        for (std::size_t i = 0; i < rays.size(); ++i) {
            radii[i] = float(exact.voxel * std::pow(10, random(-1, 2.5)));
            const glm::dvec3 target = centre + glm::dvec3(random.point(0.5 * scale + 1.2 * double(radii[i])));
            rays[i].origin =
                glm::vec3(target + (scale * random(0, 2) + double(radii[i])) * glm::dvec3(random.direction()));
            rays[i].direction = glm::vec3(target - glm::dvec3(rays[i].origin));
            rays[i].maxDistance = float(random(0.5, 4) * scale);
        }
        std::vector<std::optional<RayHit>> hits(rays.size());
        exact.field.sphereCast(rays, radii, hits);
        std::vector<std::string> faults(rays.size());
        std::atomic<int> met = 0, missed = 0;
        tbb::parallel_for(std::size_t(0), rays.size(), [&](std::size_t i) {
            const glm::dvec3 from(rays[i].origin), along = glm::normalize(glm::dvec3(rays[i].direction));
            const auto& hit = hits[i];
            const double radius = radii[i], start = exact.truth.signedDistance(from),
                         blur = room + 1e-6 * (scale + radius);
            const auto fail = [&](const char* what) { faults[i] = what; };
            if (std::abs(start - radius) < room || std::abs(start) < room) return;
            if (start < radius) {
                if (!hit || hit->distance != 0) fail("starts in touch");
                return;
            }
            if (!hit) {
                const auto expected = firstWithin(exact.truth, from, along, rays[i].maxDistance, radius, room);
                if (expected && *expected < double(rays[i].maxDistance) - blur) fail("missed");
                ++missed;
                return;
            }
            ++met;
            const glm::dvec3 end = from + double(hit->distance) * along;
            if (std::abs(exact.truth.distance(end) - radius) > blur) fail("does not touch");
            if (exact.truth.distance(glm::dvec3(hit->position)) > blur) fail("not on the surface");
            if (std::abs(glm::distance(end, glm::dvec3(hit->position)) - radius) > blur) fail("touches elsewhere");
            if (glm::distance(glm::dvec3(hit->normal), (end - glm::dvec3(hit->position)) / radius) >
                4 * blur / radius + 1e-5)
                fail("normal");
            for (int k = 0; k < 100; ++k)
                if (exact.truth.distance(from + (0.01 * k * double(hit->distance)) * along) < radius - blur)
                    fail("touches before");
        });
        for (std::size_t i = 0; i < rays.size(); ++i) {
            CAPTURE(i, radii[i] / exact.voxel);
            REQUIRE(faults[i] == "");
        }
        REQUIRE(met > 50);
        REQUIRE(missed > 20);
    }
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

TEST_CASE("a sphere that slides along a wall a hair above it passes it") {
    const Exact wall(shapes::box({0.5f, 0.5f, 0.1f}, 8), 100);
    const Field bare(levelSetOf(boxSolid({0.5, 0.5, 0.1}), 0.01));
    for (const float radius : {0.03f, 0.3f, 30.f})
        for (const auto& [gap, meets] : {std::pair(2e-3f, false), std::pair(-2e-3f, true)}) {
            const Ray ray{{-1 - radius, 0.01f, 0.1f + radius + gap * 0.01f}, {1, 0, 0}, infinity};
            CAPTURE(radius, gap);
            // single precision cannot resolve the gap at the largest radius
            if (radius > 1) {
                (void)wall.field.sphereCast(ray, radius);
                (void)bare.sphereCast(ray, radius);
                continue;
            }
            REQUIRE(bool(wall.field.sphereCast(ray, radius)) == meets);
            REQUIRE(bool(bare.sphereCast(ray, radius)) == meets);
        }
}

TEST_CASE("segments are rays that end, and many at once are the same as one by one") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const Exact knot(shapes::torusKnot(2, 3, 0.4f, 0.1f, 200, 16));
    for (const Field& field : {knot.field, Field(levelSetOf(torusSolid(0.35, 0.13), h))}) {
        std::vector<glm::vec3> from(500), to(500);
        for (std::size_t i = 0; i < from.size(); ++i) from[i] = random.point(0.6), to[i] = random.point(0.6);
        std::vector<std::optional<RayHit>> hits(from.size());
        field.segment(from, to, hits);
        int met = 0;
        for (std::size_t i = 0; i < from.size(); ++i) {
            const glm::dvec3 way = glm::dvec3(to[i]) - glm::dvec3(from[i]);
            const auto one = field.segment(from[i], to[i]);
            const auto ray = field.raycast({from[i], glm::vec3(glm::normalize(way)), float(glm::length(way))});
            REQUIRE(bool(one) == bool(ray));
            REQUIRE(bool(one) == bool(hits[i]));
            if (!one) continue;
            ++met;
            // the ray's direction is rounded to floats
            REQUIRE(std::abs(one->distance - ray->distance) < 1e-4f);
            const glm::dvec3 beside = glm::cross(glm::dvec3(one->position) - glm::dvec3(from[i]), glm::normalize(way));
            // triangles are hit by rays that pass within this tolerance; the rest is rounding of floats
            REQUIRE(glm::length(beside) < 1e-5 * double(field.voxelSize()) + 6e-8);
            REQUIRE(one->position == hits[i]->position);
            REQUIRE(double(one->distance) <= glm::length(way) * (1 + 1e-6));
        }
        REQUIRE(met > 20);
        REQUIRE_THROWS_AS(field.segment(from, std::span(to).first(3), hits), std::invalid_argument);
        std::vector<Ray> rays(3);
        std::vector<float> radii(2);
        REQUIRE_THROWS_AS(field.raycast(rays, hits), std::invalid_argument);
        REQUIRE_THROWS_AS(field.sphereCast(rays, radii, std::span(hits).first(3)), std::invalid_argument);
    }
    REQUIRE_FALSE(knot.field.segment({2, 0, 0}, {2, 0, 0}));
    REQUIRE(Field(levelSetOf(sphereSolid(0.4), h)).segment(glm::vec3(0), glm::vec3(0))->distance == 0);
}

TEST_CASE("casts of what is no ray or no sphere hit nothing") {
    const Exact exact(shapes::sphere(0.4f, 3), 40);
    const Field bare(levelSetOf(sphereSolid(0.4), h));
    for (const Field& field : {exact.field, bare}) {
        const Ray good{{1, 0, 0}, {-1, 0, 0}, 10};
        REQUIRE(field.raycast(good));
        REQUIRE(field.sphereCast(good, 0.1f)->distance == Approx(0.5).margin(2e-3));
        REQUIRE(field.sphereCast(good, 0)->distance == Approx(0.6).margin(2e-3));
        REQUIRE(field.sphereCast(good, 0.7f)->distance == 0);
        REQUIRE(field.sphereCast({{1e6f, 0, 0}, {-1, 0, 0}, infinity}, 1e5f)->distance == Approx(9e5).epsilon(1e-5));
        for (const float radius : {-0.1f, notANumber, infinity, -infinity})
            REQUIRE_FALSE(field.sphereCast(good, radius));
        for (const float bad : {notANumber, infinity, -infinity})
            for (int k = 0; k < 3; ++k) {
                Ray from = good, towards = good;
                from.origin[k] = bad;
                towards.direction[k] = bad;
                for (const Ray& ray : {from, towards}) {
                    REQUIRE_FALSE(field.raycast(ray));
                    REQUIRE_FALSE(field.sphereCast(ray, 0.1f));
                    REQUIRE_FALSE(field.segment(ray.origin, ray.origin));
                }
            }
        for (const float length : {-1.f, notANumber}) {
            REQUIRE_FALSE(field.raycast({{1, 0, 0}, {-1, 0, 0}, length}));
            REQUIRE_FALSE(field.sphereCast({{1, 0, 0}, {-1, 0, 0}, length}, 0.1f));
        }
        REQUIRE_FALSE(field.raycast({{1, 0, 0}, {0, 0, 0}, 10}));
        REQUIRE_FALSE(field.sphereCast({{1, 0, 0}, {0, 0, 0}, 10}, 0.1f));
        // they must only terminate
        (void)field.raycast({{1e30f, 1e30f, 1e30f}, {-1, -1, -1}, infinity});
        (void)field.sphereCast({{3e38f, 0, 0}, {-1, 0, 0}, infinity}, 1);
        (void)field.sphereCast({{3, 0, 0}, {-1, 0, 0}, infinity}, 3e38f);
        (void)field.raycast({{1, 0, 0}, {-1e-44f, 0, 0}, infinity});
        REQUIRE(field.raycast({{1, 0, 0}, {-1e-30f, 0, 0}, infinity}));
    }
}

TEST_CASE("segments go straight from point to point, however long, and meet the face that they end on") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const Mesh box = shapes::box(glm::vec3(0.5f));
    const LevelSet levelSet = build(box, {.voxelSize = 0.01f});
    const Field field(levelSet, box);
    for (const float length : {1.f, 1e2f, 1e4f}) {
        int missed = 0;
        for (int i = 0; i < 500; ++i) {
            const glm::vec3 end(float(random(-0.4, 0.4)), float(random(-0.4, 0.4)), 0.5f);
            const glm::vec3 start = end + length * glm::vec3(float(random(-1, 1)), float(random(-1, 1)), 1);
            const auto hit = field.segment(start, end);
            missed += !hit;
            if (hit) REQUIRE(glm::distance(hit->position, end) < 1e-6f);
        }
        CAPTURE(length);
        CHECK(missed == 0);
    }
}
