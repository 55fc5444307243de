// SPDX-License-Identifier: Apache-2.0
// closest(), inside() and sample() agree on which side of the surface a point is.
#include <oneapi/tbb/parallel_for.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <glm/gtc/constants.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <span>
#include <string>
#include <vector>

#include <bilayer/collider/field.h>
#include <bilayer/sdf/build.h>
#include <bilayer/sdf/mesh_io.h>
#include "demos/shared/shapes.h"
#include "tests/collider/query_points.h"
#include "tests/support/random.h"
#include "tests/support/support.h"
#include "tests/support/truth.h"

namespace bilayer::sides_test {
using namespace bilayer::detail;
using namespace bilayer::test;

namespace {

// A closed, oriented surface that self-intersects in places, slightly or strongly.
Mesh crumpled(Random& random) {
    const float noise = std::pow(10.f, float(random(-2.5, -0.5)));
    Mesh mesh = random(0, 1) < 0.5 ? shapes::torus(1, 0.3f, 24, 12) : shapes::sphere(1, 3);
    for (glm::vec3& p : mesh.points) p += noise * random.point(1);
    return tilted(mesh);
}

// A thin box or needle, at random.
Mesh sliver(Random& random) {
    const float thickness = std::pow(10.f, float(random(-4, -0.5)));
    const Mesh bar = random(0, 1) < 0.5 ? shapes::box({1, 0.3f, thickness}) : shapes::cone(thickness, 2, 3);
    const glm::mat4 rotation = glm::rotate(glm::mat4(1), float(random(0, glm::two_pi<double>())), random.direction());
    return shapes::moved(transformed(bar, rotation), random.point(0.3));
}

// Closed meshes whose surfaces meet, each with its own kind of wrong normals.
struct MeetingSurfaces {
    std::string name;
    Mesh mesh;
};

std::vector<MeetingSurfaces> meetingSurfaces(Random& random) {
    const Mesh ball = shapes::sphere(1, 3), core = shapes::sphere(float(random(0.2, 0.95)), 2);
    const Mesh wall = shapes::box({1, 1, 0.1f}, 2);
    const glm::vec3 shift = 0.02f * random.direction();
    Mesh slivers = sliver(random);
    for (int i = 0; i < 7; ++i) slivers = shapes::join({slivers, sliver(random)});
    return {{"crossed bars", shapes::join({shapes::box({1, 0.2f, 0.2f}), shapes::box({0.2f, 1, 0.3f})})},
            {"slivers", slivers},
            {"a hollow ball", shapes::join({ball, shapes::flipped(core)})},
            {"a ball in a ball", shapes::join({ball, core})},
            {"walls almost in one place", shapes::join({wall, shapes::moved(wall, shift)})},
            {"boxes that share an edge",
             shapes::join({shapes::box(glm::vec3(0.5f)), shapes::moved(shapes::box(glm::vec3(0.5f)), {1, 1, 0})})},
            {"a crumpled surface", crumpled(random)}};
}

// Open meshes: with holes, with sheets that stick out, and sheets alone.
std::vector<MeetingSurfaces> openMeshes(Random& random) {
    const auto withoutSome = [&](Mesh mesh, double share) {
        std::erase_if(mesh.triangles, [&](const glm::uvec3&) { return random(0, 1) < share; });
        return mesh;
    };
    const auto triangle = [&] { return Mesh{{random.point(1), random.point(1), random.point(1)}, {{0, 1, 2}}}; };
    const Mesh ball = shapes::sphere(0.7f, 3), box = shapes::box({0.5f, 0.4f, 0.3f}, 2);
    return {{"a ball with holes", withoutSome(ball, 0.05)},
            {"a torn ball", withoutSome(ball, 0.5)},
            {"a box with a fin", shapes::join({box, triangle()})},
            {"a box with many fins", shapes::join({box, triangle(), triangle(), triangle(), triangle()})},
            {"a crumpled surface with holes", withoutSome(crumpled(random), 0.05)},
            {"loose triangles", shapes::join({triangle(), triangle(), triangle()})}};
}

// Points whose side a query got wrong, of all whose winding number defines a side.
struct WrongSides {
    std::size_t points = 0, closest = 0, inside = 0, sample = 0;
    std::size_t close = 0, closeClosest = 0;  // where signs come from normals, and samples may err as normals do
};

constexpr double samePlace = 1e-4;  // closer points may be on either side [voxels]
constexpr double unchecked = 0.1;   // so close, samples cannot check normals [voxels]
constexpr double maxError = 0.87;   // of samples: half a cell's diagonal [voxels]

WrongSides wrongSides(const LevelSet& levelSet, const Mesh& mesh, std::span<const glm::vec3> points) {
    const Field field(levelSet, mesh);
    const Truth truth(mesh);
    const double voxel = double(field.voxelSize());
    const bool byNormals = levelSet.sign() == "normals";
    WrongSides wrong;
    for (const glm::vec3& p : points) {
        const double distance = truth.distance(glm::dvec3(p)) / voxel;
        const int winding = truth.winding(glm::dvec3(p));
        if (winding < 0 || distance < (byNormals ? unchecked : samePlace)) continue;
        const bool inside = winding > 0, closestInside = field.closest(p).distance < 0;
        ++wrong.points;
        wrong.inside += field.inside(p) != closestInside;
        if (byNormals && distance < maxError) {
            ++wrong.close;
            wrong.closeClosest += closestInside != inside;
            continue;
        }
        wrong.closest += closestInside != inside;
        wrong.sample += distance > maxError && (field.sample(p).distance < 0) != inside;
    }
    return wrong;
}

void requireNone(const WrongSides& wrong) {
    CAPTURE(wrong.points);
    CHECK(wrong.closest == 0);
    CHECK(wrong.inside == 0);
    CHECK(wrong.sample == 0);
}

// Counts how often queries contradict each other at points of the band, of the box, and far away.
struct Contradictions {
    std::size_t points = 0, inside = 0, sample = 0, batch = 0;
};

Contradictions contradictions(const Field& field, std::span<const glm::vec3> points) {
    std::vector<ClosestPoint> batch(points.size());
    field.closest(points, batch);
    Contradictions found;
    for (std::size_t i = 0; i < points.size(); ++i) {
        const ClosestPoint closest = field.closest(points[i]);
        const Sample sample = field.sample(points[i]);
        const bool inside = closest.distance < 0;
        ++found.points;
        found.inside += field.inside(points[i]) != inside;
        // then all voxels around the point lie on its side
        const bool known = std::abs(closest.distance) > std::sqrt(3.f) * field.voxelSize();
        found.sample += known && (sample.distance < 0) != inside;
        found.batch += !same(closest, batch[i]);
    }
    return found;
}

void requireNone(const Contradictions& found) {
    CAPTURE(found.points);
    CHECK(found.inside == 0);
    CHECK(found.sample == 0);
    CHECK(found.batch == 0);
}

}  // namespace

TEST_CASE("closest, inside and sample agree on the side where the surface runs through itself by rounding") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    const auto path = corpusMesh("../cases/sliver110.obj");
    if (!path) return;
    Mesh mesh = readMesh(*path);
    // without an origin, as floats round it
    for (glm::vec3& point : mesh.points) point = glm::vec3(mesh.origin + glm::dvec3(point));
    mesh.origin = glm::dvec3(0);
    const Field field(build(mesh, {.voxelSize = voxelSizeFor(mesh, 64)}), mesh);
    const glm::vec3 given(5329.89f, -20239.19f, 1423.04f);
    CHECK(field.closest(given).distance > 0);
    CHECK_FALSE(field.inside(given));
    CHECK(field.sample(given).distance > 0);
    Random random(seed);
    const Bounds box = bounds(mesh);
    std::vector<glm::vec3> points = pointsAround(mesh, double(field.voxelSize()), 5000, seed);
    for (int i = 0; i < 20000; ++i) points.push_back(box.centre() + random.point(1000 * double(box.longestSide())));
    requireNone(contradictions(field, points));
}

TEST_CASE("closest, inside and sample agree on the side for any mesh and sign method") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (int round = 0; round < 24; ++round) {
        const Mesh mesh = crumpled(random);
        const float voxelSize = voxelSizeFor(mesh, float(random(10, 60)));
        for (const Sign sign : {Sign::automatic, Sign::normals, Sign::flood}) {
            CAPTURE(round, voxelSize, sign);
            const LevelSet levelSet = build(mesh, {.voxelSize = voxelSize, .sign = sign});
            const std::vector<glm::vec3> points = pointsAround(mesh, double(voxelSize), 1500, seed + unsigned(round));
            Contradictions found = contradictions(Field(levelSet, mesh), points);
            // contradicting voxels form no valid interpolant, and a flood closes gaps half-way between walls
            if (levelSet.signConflicts() > 0 || sign == Sign::flood) found.sample = 0;
            requireNone(found);
        }
    }
}

TEST_CASE("closest, inside and sample have the side of the winding number where surfaces meet") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    std::size_t close = 0, wrong = 0;
    for (int round = 0; round < 3; ++round)
        for (const auto& [name, shape] : meetingSurfaces(random)) {
            const Mesh mesh = tilted(shape);
            const float voxelSize = voxelSizeFor(mesh, float(random(12, 50)));
            const LevelSet levelSet = build(mesh, {.voxelSize = voxelSize});
            CAPTURE(round, name, voxelSize, levelSet.signReason());
            // signs of a flood, and of voxels that contradict each other, are not those of winding numbers
            if (levelSet.sign() == "flood" || levelSet.signConflicts() > 0) continue;
            const WrongSides found =
                wrongSides(levelSet, mesh, pointsAround(mesh, 0.4 * double(voxelSize), 3000, seed));
            requireNone(found);
            close += found.close, wrong += found.closeClosest;
        }
    // of all meshes together: slivers that cross within a voxel may have several of these, most meshes have none
    CHECK(wrong <= close / 2000);
}

TEST_CASE("closest, inside and sample have the side of the winding number on public meshes that self-intersect") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    for (const char* name : {"../cases/sliver110.obj", "../cases/crossed-bars.obj", "diff_ring.stl"}) {
        const auto path = corpusMesh(name);
        if (!path) continue;
        CAPTURE(name);
        const Mesh mesh = readMesh(*path);
        const LevelSet levelSet = build(mesh, {.voxelSize = voxelSizeFor(mesh, 64)});
        Random random(seed);
        const Bounds box = bounds(mesh);
        std::vector<glm::vec3> points = pointsAround(mesh, double(levelSet.voxelSize()), 10000, seed);
        for (int i = 0; i < 50000; ++i) points.push_back(box.centre() + random.point(0.5 * double(box.longestSide())));
        const WrongSides found = wrongSides(levelSet, mesh, points);
        CAPTURE(found.close);
        requireNone(found);
        CHECK(found.closeClosest <= found.close / 10000);
    }
}

TEST_CASE("closest and inside have the side of the winding number near the surface of an open mesh") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    std::size_t wrong = 0, points = 0;
    for (int round = 0; round < 3; ++round)
        for (const auto& [name, shape] : openMeshes(random)) {
            const Mesh mesh = tilted(shape);
            const float voxelSize = voxelSizeFor(mesh, float(random(12, 50)));
            const LevelSet levelSet = build(mesh, {.voxelSize = voxelSize, .sign = Sign::winding});
            const Field field(levelSet, mesh);
            const Truth truth(mesh);
            CAPTURE(round, name, voxelSize);
            for (const glm::vec3& p : pointsAround(mesh, 0.1 * double(voxelSize), 3000, seed)) {
                const double winding = windingNumber(mesh, glm::dvec3(p));
                const ClosestPoint closest = field.closest(p);
                REQUIRE(field.inside(p) == (closest.distance < 0));
                const glm::dvec3 voxel = double(voxelSize) * glm::round(glm::dvec3(p) / double(voxelSize));
                // in a hole, the side changes without a surface
                const bool isVoxels = glm::distance(voxel, glm::dvec3(p)) < truth.distance(voxel);
                if (isVoxels || truth.distance(glm::dvec3(p)) < samePlace * double(voxelSize)) continue;
                if (std::abs(winding - 0.5) < 1e-6) continue;
                ++points;
                wrong += (closest.distance < 0) != (winding > 0.5);
            }
        }
    CHECK(points > 20000);
    // of all meshes together: two surfaces within a third of a voxel may have several of these, most meshes have none
    CHECK(wrong <= points / 500);
}
}  // namespace bilayer::sides_test
