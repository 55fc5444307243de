// SPDX-License-Identifier: Apache-2.0
// Ray casts, segment casts and sphere sweeps: with the mesh against brute force over all triangles in double precision,
// without it against the interpolant.
#include <oneapi/tbb/parallel_for.h>

#include <atomic>
#include <catch2/catch.hpp>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <optional>
#include <vector>

#include <bilayer/collider/field.h>
#include <bilayer/sdf/build.h>
#include <bilayer/sdf/mesh_io.h>
#include "demos/shared/shapes.h"
#include "tests/support/analytic.h"
#include "tests/support/random.h"
#include "tests/support/support.h"
#include "tests/support/truth.h"

namespace bilayer::field_rays_test {
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

TEST_CASE("with the mesh, rays hit its surface, and nothing before it") {
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

TEST_CASE("a sphere that moves along a wall slightly above it does not hit it") {
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
            const glm::dvec3 displacement = glm::dvec3(to[i]) - glm::dvec3(from[i]);
            const auto one = field.segment(from[i], to[i]);
            const auto ray =
                field.raycast({from[i], glm::vec3(glm::normalize(displacement)), float(glm::length(displacement))});
            REQUIRE(bool(one) == bool(ray));
            REQUIRE(bool(one) == bool(hits[i]));
            if (!one) continue;
            ++met;
            // the ray's direction is rounded to floats
            REQUIRE(std::abs(one->distance - ray->distance) < 1e-4f);
            const glm::dvec3 offset =
                glm::cross(glm::dvec3(one->position) - glm::dvec3(from[i]), glm::normalize(displacement));
            // triangles are hit by rays that pass within this tolerance; the rest is rounding of floats
            REQUIRE(glm::length(offset) < 1e-5 * double(field.voxelSize()) + 6e-8);
            REQUIRE(one->position == hits[i]->position);
            REQUIRE(double(one->distance) <= glm::length(displacement) * (1 + 1e-6));
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

TEST_CASE("casts of invalid rays and spheres hit nothing") {
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

TEST_CASE("segments are exact at any length, and hit the face that they end on") {
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
}  // namespace bilayer::field_rays_test
