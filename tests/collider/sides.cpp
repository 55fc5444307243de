// SPDX-License-Identifier: Apache-2.0
// closest(), inside() and sample() agree on which side of the surface a point is.
#include <oneapi/tbb/parallel_for.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <span>
#include <vector>

#include <bilayer/collider/field.h>
#include <bilayer/sdf/build.h>
#include <bilayer/sdf/mesh_io.h>
#include "demos/shared/shapes.h"
#include "query_points.h"
#include "tests/support/random.h"
#include "tests/support/support.h"

using namespace bilayer;
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
    const Mesh mesh = readMesh(*path);
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
