// SPDX-License-Identifier: Apache-2.0
// Points, spheres and boxes against the solid, and closest points of fields without their mesh.
#include <oneapi/tbb/parallel_for.h>

#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <limits>
#include <memory>
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

namespace bilayer::field_overlaps_test {
using namespace bilayer::test;

namespace {

constexpr double h = 0.02;  // of most fields here [m]
constexpr float infinity = std::numeric_limits<float>::infinity();
constexpr float notANumber = std::numeric_limits<float>::quiet_NaN();

std::vector<Mesh> closedMeshes() {
    std::vector<Mesh> meshes{shapes::torusKnot(2, 3, 0.4f, 0.1f, 200, 16), shapes::bowl(0.5f, 0.004f, 64),
                             shapes::box(glm::vec3(0.5f))};
    for (const char* name : {"bunny_watertight.obj", "fandisk.obj", "cgal-cheese.off"})
        if (const auto path = corpusMesh(name)) meshes.push_back(readMesh(*path));
    return meshes;
}

Field withMesh(const Mesh& mesh, const FieldOptions& options = {}, float resolution = 48) {
    return Field(build(mesh, {.voxelSize = voxelSizeFor(mesh, resolution)}), mesh, options);
}

// Near the surface, in the band, inside or far away.
glm::vec3 somewhere(Random& random, const Mesh& mesh, float voxel) {
    const glm::vec3 vertex = mesh.points[mesh.triangles[std::size_t(random(0, double(mesh.triangles.size())))].x];
    const float scale = bounds(mesh).longestSide();
    switch (int(random(0, 4))) {
        case 0:
            return vertex + voxel * float(std::pow(10, random(-4, 0.5))) * random.direction();
        case 1:
            return bounds(mesh).centre() + random.point(0.5 * double(scale));
        case 2:
            return vertex + 5 * voxel * random.direction();
        default:
            return bounds(mesh).centre() + scale * float(std::pow(10, random(-1, 3))) * random.direction();
    }
}

OrientedBox someBox(Random& random, const glm::vec3& centre, double size) {
    OrientedBox box{centre, glm::vec3(0), glm::angleAxis(float(random(0, 3)), random.direction())};
    if (random(0, 1) < 0.2) box.rotation = {1, 0, 0, 0};
    for (int k = 0; k < 3; ++k) box.halfSize[k] = float(size * std::pow(10, random(-2, 0)));
    return box;
}

// Visits a grid of points in a box, including its corners.
template <class Visit>
void forPointsIn(const OrientedBox& box, int count, Visit visit) {
    for (int x = 0; x < count; ++x)
        for (int y = 0; y < count; ++y)
            for (int z = 0; z < count; ++z) {
                const glm::vec3 at = 2.f / float(count - 1) * glm::vec3(x, y, z) - 1.f;
                visit(box.centre + box.rotation * (at * box.halfSize));
            }
}

}  // namespace

TEST_CASE("with the mesh, points are inside where its surface winds around them") {
    const FieldOptions options{GENERATE(Storage::float32, Storage::fixed16)};
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (const Mesh& mesh : closedMeshes()) {
        const Field field = withMesh(mesh, options);
        const Truth truth(mesh);
        const std::size_t count = 3000;
        std::vector<glm::vec3> points(count);
        for (glm::vec3& p : points) p = somewhere(random, mesh, field.voxelSize());
        const auto answers = std::make_unique<bool[]>(count);
        field.inside(points, std::span(answers.get(), count));
        int within = 0;
        for (std::size_t i = 0; i < count; ++i) {
            CAPTURE(mesh.triangles.size(), i, points[i].x, points[i].y, points[i].z);
            REQUIRE(field.inside(points[i]) == answers[i]);
            const double distance = truth.signedDistance(glm::dvec3(points[i]));
            if (std::abs(distance) < 1e-5 * double(field.voxelSize())) continue;
            REQUIRE(answers[i] == (distance < 0));
            within += answers[i];
        }
        REQUIRE(within > 50);
    }
}

TEST_CASE("Flipped triangles do not swap inside and outside") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    Mesh mesh = shapes::sphere(0.4f, 3);
    const Truth truth(mesh);
    for (glm::uvec3& t : mesh.triangles)
        if (random(0, 1) < 0.4) std::swap(t.x, t.y);
    const LevelSet levelSet = build(mesh, {.voxelSize = 0.02f});
    for (const Field& field : {Field(levelSet), Field(levelSet, mesh)})
        for (int i = 0; i < 5000; ++i) {
            const glm::vec3 p = random.point(0.5);
            const double distance = truth.signedDistance(glm::dvec3(p));
            if (std::abs(distance) < 0.05 * 0.02) continue;
            CAPTURE(i, distance);
            REQUIRE(field.inside(p) == (distance < 0));
            REQUIRE(bool(field.raycast({p, random.direction(), 1e-4f})) == (distance < 0));
        }
}

TEST_CASE("with the mesh, spheres overlap where it is near enough") {
    const FieldOptions options{GENERATE(Storage::float32, Storage::fixed16)};
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (const Mesh& mesh : closedMeshes()) {
        const Field field = withMesh(mesh, options);
        const Truth truth(mesh);
        const std::size_t count = 2000;
        std::vector<glm::vec3> centres(count);
        std::vector<float> radii(count);
        std::vector<double> distances(count);
        for (std::size_t i = 0; i < count; ++i) {
            centres[i] = somewhere(random, mesh, field.voxelSize());
            distances[i] = truth.signedDistance(glm::dvec3(centres[i]));
            // about the required size, or far from it
            radii[i] = float(std::abs(distances[i]) * (1 + random(-1, 1) * std::pow(10, random(-6, 0))));
        }
        const auto answers = std::make_unique<bool[]>(count);
        field.overlapsSphere(centres, radii, std::span(answers.get(), count));
        int overlapping = 0;
        for (std::size_t i = 0; i < count; ++i) {
            const double left = distances[i] - double(radii[i]);
            CAPTURE(mesh.triangles.size(), i, distances[i] / double(field.voxelSize()), radii[i] / field.voxelSize());
            REQUIRE(field.overlapsSphere(centres[i], radii[i]) == answers[i]);
            overlapping += answers[i];
            if (std::abs(left) > 1e-4 * double(field.voxelSize()) + 2e-6 * std::abs(distances[i]))
                REQUIRE(answers[i] == (left < 0));
        }
        REQUIRE(overlapping > 200);
        REQUIRE(overlapping < 1900);
    }
}

TEST_CASE("with the mesh, boxes overlap where they hold a point of the solid") {
    const FieldOptions options{GENERATE(Storage::float32, Storage::fixed16)};
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (const Mesh& mesh : closedMeshes()) {
        const Field field = withMesh(mesh, options);
        const Truth truth(mesh);
        const double scale = bounds(mesh).longestSide();
        int overlapping = 0;
        const int count = 300;
        for (int i = 0; i < count; ++i) {
            const OrientedBox box = someBox(random, somewhere(random, mesh, field.voxelSize()), 0.5 * scale);
            const bool answer = field.overlapsBox(box);
            bool answers[1];
            field.overlapsBox(std::span(&box, 1), answers);
            REQUIRE(answers[0] == answer);
            overlapping += answer;
            CAPTURE(mesh.triangles.size(), i);
            double least = infinity;
            forPointsIn(box, 9,
                        [&](const glm::vec3& p) { least = std::min(least, truth.signedDistance(glm::dvec3(p))); });
            if (least < -1e-5 * scale) REQUIRE(answer);
            // no point of the box is farther from these than half a diagonal of the grid's cells
            if (least > double(glm::length(box.halfSize)) / 8) REQUIRE_FALSE(answer);
        }
        REQUIRE(overlapping > 30);
        REQUIRE(overlapping < count - 30);
    }
}

TEST_CASE("without the mesh, the closest point is a zero, and there is none nearer") {
    const FieldOptions options{GENERATE(Storage::float32, Storage::fixed16)};
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (const Solid& solid : smallSolids())
        for (const float width : {3.f, 1.8f}) {
            const Field field(levelSetOf(solid, h, width, width), options);
            for (int i = 0; i < 500; ++i) {
                const glm::vec3 p = i % 3 ? random.point(0.6) : float(std::pow(10, random(0, 5))) * random.direction();
                const ClosestPoint closest = field.closest(p);
                CAPTURE(width, i, p.x, p.y, p.z);
                REQUIRE(closest.found);
                REQUIRE(closest.triangle == noTriangle);
                REQUIRE(std::signbit(closest.distance) == std::signbit(field.distance(p)));
                const float away = std::abs(closest.distance), blur = float(1e-3 * h) + 1e-6f * away;
                REQUIRE(std::abs(glm::distance(p, closest.position) - away) < blur);
                REQUIRE(std::abs(field.distance(closest.position)) < 2e-3f * float(h));
                REQUIRE(glm::length(closest.normal) == Approx(1).margin(1e-4));
                // the whole ball is on the side of its centre
                if (away > 10) continue;
                const float clear = std::max(away - 3 * blur, 0.f);
                for (int k = 0; k < 200; ++k) {
                    const glm::vec3 q = p + clear * float(std::cbrt(random(0, 1))) * random.direction();
                    REQUIRE((field.distance(q) < 0) == (closest.distance < 0));
                }
                REQUIRE(field.closest(p, away * 1.01f + blur).found);
                if (away > 0.1f * float(h)) REQUIRE_FALSE(field.closest(p, away * 0.99f - 2 * blur).found);
                REQUIRE(field.overlapsSphere(p, away + 2 * blur));
                if (closest.distance > 2 * blur) REQUIRE_FALSE(field.overlapsSphere(p, away - 2 * blur));
                if (closest.distance < 0) REQUIRE(field.overlapsSphere(p, 0));
            }
        }
}

TEST_CASE("without the mesh, boxes overlap where they hold a negative sample") {
    const FieldOptions options{GENERATE(Storage::float32, Storage::fixed16)};
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (const Solid& solid : smallSolids()) {
        const Field field(levelSetOf(solid, h), options);
        int overlapping = 0;
        const int count = 500;
        for (int i = 0; i < count; ++i) {
            const OrientedBox box = someBox(random, random.point(0.7), 0.4);
            const bool answer = field.overlapsBox(box);
            overlapping += answer;
            CAPTURE(i);
            double least = infinity;
            forPointsIn(box, 13, [&](const glm::vec3& p) { least = std::min(least, double(field.distance(p))); });
            if (least < -1e-5 * h) REQUIRE(answer);
            // the gradient of the interpolant is at most 1.74
            if (least > 1.74 * double(glm::length(box.halfSize)) / 12 + 2e-3 * h) REQUIRE_FALSE(answer);
        }
        REQUIRE(overlapping > 30);
        REQUIRE(overlapping < count - 30);
    }
}

TEST_CASE("boxes flush with a wall are quick and right to a thousandth of a voxel") {
    const Field bare(levelSetOf(boxSolid({0.5, 0.5, 0.1}), 0.01)),
        exact = withMesh(shapes::box({0.5f, 0.5f, 0.1f}), {}, 100);
    for (const Field& field : {bare, exact})
        for (const float gap : {-2e-5f, 2e-5f}) {
            CAPTURE(gap, field.mesh() != nullptr);
            REQUIRE(field.overlapsBox({{0, 0, 0.2f + gap}, {0.6f, 0.6f, 0.1f}, {1, 0, 0, 0}}) == (gap < 0));
            REQUIRE(field.overlapsBox({{0, 0, 0.2f + gap}, {0.3f, 0.3f, 0.1f}, {0.8f, 0, 0, 0.6f}}) == (gap < 0));
            REQUIRE(field.overlapsSphere({0, 0, 0.2f + gap}, 0.1f) == (gap < 0));
        }
}

TEST_CASE("overlaps of what is no sphere and no box are none") {
    const Field bare(levelSetOf(sphereSolid(0.4), h)), exact = withMesh(shapes::sphere(0.4f, 3));
    for (const Field& field : {bare, exact}) {
        REQUIRE(field.inside({0, 0, 0}));
        REQUIRE(field.overlapsSphere({0, 0, 0}, 0));
        REQUIRE(field.overlapsSphere({1e6f, 0, 0}, 1.1e6f));
        REQUIRE(field.overlapsBox({{0, 0, 0}, glm::vec3(0), {1, 0, 0, 0}}));
        REQUIRE(field.overlapsBox({{1e6f, 0, 0}, glm::vec3(1.1e6f), {1, 0, 0, 0}}));
        REQUIRE(field.overlapsBox({{0, 0, 0}, glm::vec3(0.1f), {3, 0, 0, 0}}));  // of any length
        for (const float bad : {notANumber, infinity, -infinity}) {
            for (int k = 0; k < 3; ++k) {
                glm::vec3 p(0);
                p[k] = bad;
                REQUIRE_FALSE(field.inside(p));
                REQUIRE_FALSE(field.closest(p).found);
                REQUIRE_FALSE(field.overlapsSphere(p, 1));
                REQUIRE_FALSE(field.overlapsBox({p, glm::vec3(1), {1, 0, 0, 0}}));
                REQUIRE_FALSE(field.overlapsBox({glm::vec3(0), p, {1, 0, 0, 0}}));
            }
            REQUIRE_FALSE(field.overlapsSphere({0, 0, 0}, bad));
            REQUIRE_FALSE(field.overlapsBox({glm::vec3(0), glm::vec3(1), {bad, 0, 0, 0}}));
        }
        REQUIRE_FALSE(field.overlapsSphere({0, 0, 0}, -1));
        REQUIRE_FALSE(field.closest({1, 0, 0}, -1).found);
        REQUIRE_FALSE(field.closest({1, 0, 0}, notANumber).found);
        REQUIRE_FALSE(field.overlapsBox({glm::vec3(0), {1, -1, 1}, {1, 0, 0, 0}}));
        REQUIRE_FALSE(field.overlapsBox({glm::vec3(0), glm::vec3(1), {0, 0, 0, 0}}));
        (void)field.overlapsSphere({3e38f, 3e38f, 3e38f}, 3e38f);
        (void)field.overlapsBox({glm::vec3(3e38f), glm::vec3(3e38f), {1, 0, 0, 0}});
    }
    const std::vector<glm::vec3> points(2);
    const std::vector<float> radii(2);
    const std::vector<OrientedBox> boxes(2);
    bool answers[3];
    REQUIRE_THROWS_AS(bare.inside(points, answers), std::invalid_argument);
    REQUIRE_THROWS_AS(bare.overlapsSphere(points, radii, answers), std::invalid_argument);
    REQUIRE_THROWS_AS(bare.overlapsBox(boxes, answers), std::invalid_argument);
}
}  // namespace bilayer::field_overlaps_test
