// SPDX-License-Identifier: Apache-2.0
#include <bilayer/collider/mass.h>

#include <oneapi/tbb/global_control.h>
#include <openvdb/tools/Composite.h>

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <glm/geometric.hpp>
#include <glm/gtc/constants.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <glm/vector_relational.hpp>
#include <random>
#include <stdexcept>

#include <bilayer/collider/collider.h>
#include <bilayer/sdf/build.h>
#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/mesh_io.h>
#include "demos/shared/shapes.h"
#include "sdf/base/openvdb.h"
#include "tests/collider/mass_formulas.h"
#include "tests/collider/union_boxes.h"
#include "tests/support/analytic.h"
#include "tests/support/clean.h"
#include "tests/support/random.h"
#include "tests/support/support.h"

namespace bilayer::mass_test {
using namespace bilayer::test;

namespace {

constexpr double pi = glm::pi<double>();

void requireNear(const glm::vec3& a, const glm::vec3& b, double margin) {
    CAPTURE(a.x, a.y, a.z, b.x, b.y, b.z);
    REQUIRE(glm::length(a - b) <= margin);
}

void requireNear(const glm::mat3& a, const glm::mat3& b, double margin) {
    for (int i = 0; i < 3; ++i) requireNear(a[i], b[i], margin);
}

// Checks that the axes rotate the diagonal of principal moments into the inertia tensor, without reflection.
void requireDiagonalises(const MassProperties& mass) {
    const glm::mat3 axes = glm::mat3_cast(mass.principalAxes);
    glm::mat3 diagonal(0);
    for (int i = 0; i < 3; ++i) diagonal[i][i] = mass.principalInertia[i];
    requireNear(axes * diagonal * glm::transpose(axes), mass.inertia, 2e-6 * mass.principalInertia.z);
    REQUIRE(glm::length(mass.principalAxes) == Approx(1).epsilon(1e-6));
    REQUIRE(mass.principalInertia.x <= mass.principalInertia.y);
    REQUIRE(mass.principalInertia.y <= mass.principalInertia.z);
}

// Compares with the mass of `formula` to a relative tolerance; `size` is that of the solid [m].
void requireMass(const MassProperties& mass, const MassProperties& formula, double part, double size) {
    CAPTURE(mass.volume, formula.volume);
    REQUIRE(mass.volume == Approx(formula.volume).epsilon(part));
    requireNear(mass.centre, formula.centre, part * size);
    requireNear(mass.inertia, formula.inertia, part * double(formula.principalInertia.z));
    requireNear(mass.principalInertia, formula.principalInertia, part * double(formula.principalInertia.z));
    requireDiagonalises(mass);
}

// The field with a modified copy of the grid.
LevelSet withGrid(const LevelSet& field, auto change) {
    const auto grid = field.grids().distance->deepCopy();
    change(*grid);
    return LevelSet(std::make_shared<Grids>(Grids{grid, nullptr}));
}

glm::mat4 randomMotion(Random& random) {
    const glm::quat turn = glm::angleAxis(float(random(0, 6.28)), random.direction());
    return glm::translate(glm::mat4(1), random.point(3)) * glm::mat4_cast(turn);
}

}  // namespace

TEST_CASE("a box has the mass of the formula") {
    const MassProperties mass = massProperties(shapes::box({0.5f, 1, 1.5f}, 3));  // 1 x 2 x 3
    REQUIRE(mass.volume == Approx(6).epsilon(1e-12));
    requireNear(mass.centre, glm::vec3(0), 1e-7);
    requireNear(mass.principalInertia, glm::vec3(2.5f, 5, 6.5f), 1e-6);  // z, y, x
    requireDiagonalises(mass);
    REQUIRE(mass.inertia[0][0] == Approx(6.5));
    REQUIRE(mass.inertia[1][1] == Approx(5));
    REQUIRE(mass.inertia[2][2] == Approx(2.5));
}

TEST_CASE("a sphere and a torus approach the formulas as their meshes get finer") {
    const double r = 0.7, ball = 4. / 3 * pi * r * r * r;
    const MassProperties sphere = massProperties(shapes::sphere(0.7f, 6));
    REQUIRE(sphere.volume == Approx(ball).epsilon(1e-3));
    requireNear(sphere.principalInertia, glm::vec3(0.4 * ball * r * r), 2e-3 * 0.4 * ball * r * r);
    requireDiagonalises(sphere);

    const double major = 1, minor = 0.3, ring = 2 * pi * pi * major * minor * minor;
    const double axial = ring * (major * major + 0.75 * minor * minor);
    const double across = ring * (0.5 * major * major + 0.625 * minor * minor);
    const MassProperties torus = massProperties(shapes::torus(1, 0.3f, 400, 200));
    REQUIRE(torus.volume == Approx(ring).epsilon(1e-3));
    requireNear(torus.principalInertia, glm::vec3(across, across, axial), 2e-3 * axial);
    requireDiagonalises(torus);
}

TEST_CASE("mass moves and turns with the mesh, far from the origin too") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const Mesh mesh =
        shapes::join({shapes::box({0.5f, 0.2f, 0.3f}), shapes::moved(shapes::sphere(0.3f, 3), {0.9f, 0.6f, 0.1f})});
    const MassProperties still = massProperties(mesh);
    for (int i = 0; i < 50; ++i) {
        const glm::mat4 motion = randomMotion(random);
        const glm::mat3 turn(motion);
        const MassProperties moved = massProperties(transformed(mesh, motion));
        REQUIRE(moved.volume == Approx(still.volume).epsilon(1e-5));
        requireNear(moved.centre, glm::vec3(motion * glm::vec4(still.centre, 1)), 2e-6);
        requireNear(moved.inertia, turn * still.inertia * glm::transpose(turn), 2e-5 * still.principalInertia.z);
        requireNear(moved.principalInertia, still.principalInertia, 2e-5 * still.principalInertia.z);
        requireDiagonalises(moved);
    }
    // powers of two: the mesh itself is moved without rounding
    const MassProperties box = massProperties(shapes::moved(shapes::box({0.5f, 1, 1.5f}), {8192, -8192, 4096}));
    REQUIRE(box.volume == Approx(6).epsilon(1e-9));
    requireNear(box.centre, {8192, -8192, 4096}, 0);
    requireNear(box.principalInertia, {2.5f, 5, 6.5f}, 1e-5);
}

TEST_CASE("an inside-out mesh has the mass of its reverse") {
    const Mesh mesh = shapes::torus(1, 0.3f);
    const MassProperties right = massProperties(mesh);
    const MassProperties wrong = massProperties(shapes::flipped(mesh));
    REQUIRE(wrong.volume == Approx(right.volume));
    requireNear(wrong.centre, right.centre, 1e-6);
    requireNear(wrong.inertia, right.inertia, 1e-6);
}

TEST_CASE("a hollow weighs what its walls weigh") {
    const Mesh hole = shapes::flipped(shapes::box({0.5f, 0.5f, 0.5f}));
    const MassProperties mass = massProperties(shapes::join({shapes::box({1, 1, 1}), hole}));
    REQUIRE(mass.volume == Approx(7));
    REQUIRE(mass.principalInertia.x == Approx(8 * 4 / 6. - 1 * 1 / 6.));
}

TEST_CASE("sizes from microns to kilometres keep their digits") {
    for (const float scale : {1e-6f, 1e-3f, 1e3f}) {
        const MassProperties mass = massProperties(shapes::box(scale * glm::vec3(0.5f, 1, 1.5f)));
        REQUIRE(mass.volume == Approx(6 * std::pow(double(scale), 3)).epsilon(1e-6));
        requireDiagonalises(mass);
    }
}

TEST_CASE("what encloses nothing has no mass") {
    REQUIRE_THROWS_AS(massProperties(Mesh{}), std::invalid_argument);
    const Mesh sheet{{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}, {{0, 1, 2}, {0, 2, 3}}};
    REQUIRE_THROWS_AS(massProperties(sheet), std::invalid_argument);
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (int i = 0; i < 20; ++i)
        REQUIRE_THROWS_AS(massProperties(transformed(sheet, randomMotion(random))), std::invalid_argument);
}

TEST_CASE("a field has the mass of the formula") {
    const double part = 2e-3;  // 64 voxels along the longest side
    requireMass(massProperties(levelSetOf(sphereSolid(0.7, {3.1, -2, 0.4}), 1.4 / 64)), ballMass(0.7, {3.1f, -2, 0.4f}),
                1e-4, 0.7);
    requireMass(massProperties(levelSetOf(boxSolid({0.97, 0.71, 0.53}), 1.94 / 64)), boxMass({0.97, 0.71, 0.53}), part,
                1);
    requireMass(massProperties(levelSetOf(torusSolid(1, 0.3), 2.6 / 64)), torusMass(1, 0.3), 1e-4, 1);
    const LevelSet far = levelSetOf(sphereSolid(0.7, {4096, -8192, 2048}), 1.4 / 64);
    requireMass(massProperties(far), ballMass(0.7, {4096, -8192, 2048}), 2e-3,
                0.7);  // the centre is rounded to a float
}

TEST_CASE("the mass of a field converges: third order where it is smooth") {
    const auto error = [](const LevelSet& field, const MassProperties& formula) {
        const MassProperties mass = massProperties(field);
        return std::max(std::abs(mass.volume / formula.volume - 1),
                        std::abs(double(mass.principalInertia.z / formula.principalInertia.z) - 1));
    };
    const auto sphere = [&](double voxels) {
        return error(levelSetOf(sphereSolid(1, {0.1, 0.2, 0.3}), 2 / voxels), ballMass(1));
    };
    const auto torus = [&](double voxels) {
        return error(levelSetOf(torusSolid(1, 0.4), 2.8 / voxels), torusMass(1, 0.4));
    };
    const auto box = [&](double voxels) {
        return error(levelSetOf(boxSolid({0.97, 0.71, 0.53}), 1.94 / voxels), boxMass({0.97, 0.71, 0.53}));
    };
    // a tolerance for each resolution, at 32 voxels: the error falls by 8 per doubling for smooth shapes, by 4 for the
    // box
    for (const double voxels : {32., 64., 128.}) {
        const double finer = voxels / 32;
        CAPTURE(voxels);
        CHECK(sphere(voxels) < 2e-4 / std::pow(finer, 3));
        CHECK(torus(voxels) < 8e-4 / std::pow(finer, 3));
        CHECK(box(voxels) < 1e-2 / std::pow(finer, 2));
    }
}

TEST_CASE("mesh and field agree on the mass of clean meshes") {
    const auto area = [](const Mesh& mesh) {
        double sum = 0;
        for (const glm::uvec3& t : mesh.triangles) {
            const glm::dvec3 a = mesh.points[t.x], b = mesh.points[t.y], c = mesh.points[t.z];
            sum += 0.5 * glm::length(glm::cross(b - a, c - a));
        }
        return sum;
    };
    // no field resolves walls thinner than two voxels; the mean thickness of a solid is twice its volume over its area
    const double minThickness = 3;  // [voxels]
    int compared = 0;
    for (const std::string& name : cleanMeshes()) {
        const auto path = corpusMesh(name);
        if (!path) continue;
        const Mesh mesh = readMesh(*path);
        if (mesh.triangles.size() > 120'000) continue;  // limits the run time
        const MassProperties exact = massProperties(mesh);
        const float voxel = voxelSizeFor(mesh, 128);
        if (2 * exact.volume / area(mesh) < minThickness * double(voxel)) continue;
        CAPTURE(name);
        requireMass(massProperties(build(mesh, {.voxelSize = voxel})), exact, 5e-3, double(bounds(mesh).longestSide()));
        ++compared;
    }
    CHECK((compared == 0 || compared >= 35));
}

TEST_CASE("the mass of a field knows hollows, tiles, and inactive insides") {
    // a large box, so that nodes of 8 and more voxels lie inside; the same with tiles only
    const LevelSet box = levelSetOf(boxSolid({1, 1.5, 2}), 0.02);
    const MassProperties mass = massProperties(box);
    requireMass(mass, boxMass({1, 1.5, 2}), 1e-3, 2);
    const LevelSet hollow = withGrid(box, [](openvdb::FloatGrid& grid) {
        const auto hole = levelSetOf(sphereSolid(0.7), 0.02).grids().distance->deepCopy();
        openvdb::tools::csgDifference(grid, *hole);
    });
    const MassProperties solid = boxMass({1, 1.5, 2}), ball = ballMass(0.7);
    requireMass(massProperties(hollow),
                massOf(solid.volume - ball.volume,
                       {solid.inertia[0][0] - ball.inertia[0][0], solid.inertia[1][1] - ball.inertia[1][1],
                        solid.inertia[2][2] - ball.inertia[2][2]}),
                1e-3, 2);
    // the inside is inactive, and the rest of the band determines the surface to half a voxel
    const LevelSet outer = withGrid(box, [](openvdb::FloatGrid& grid) {
        for (auto value = grid.beginValueOn(); value; ++value)
            if (*value < 0) {
                value.setValue(-grid.background());
                value.setValueOff();
            }
        openvdb::tools::prune(grid.tree());
    });
    requireMass(massProperties(outer), boxMass({1, 1.5, 2}), 0.03, 2);
    // the storage of the inside has no influence either
    const LevelSet dense = withGrid(box, [](openvdb::FloatGrid& grid) { grid.tree().voxelizeActiveTiles(); });
    const LevelSet leaves = withGrid(box, [](openvdb::FloatGrid& grid) {
        for (int x = -40; x <= 40; x += 8) grid.tree().touchLeaf({x, 0, 0});
    });
    REQUIRE(massProperties(dense).volume == mass.volume);
    REQUIRE(massProperties(leaves).volume == Approx(mass.volume).epsilon(1e-12));
    requireMass(massProperties(leaves), mass, 1e-6, 2);
}

TEST_CASE("bands of any width give a mass") {
    const MassProperties formula = ballMass(0.7);
    for (const float width : {0.01f, 0.3f, 0.9f, 1.5f, 2.5f, 8.f}) {
        CAPTURE(width);
        // with widths below a voxel each surface crossing is known only to half a voxel, but without bias on average
        requireMass(massProperties(levelSetOf(sphereSolid(0.7), 1.4 / 64, width, width)), formula,
                    width < 2 ? 0.02 : 1e-3, 0.7);
    }
}

TEST_CASE("the field of a union has the volume of the union") {
    const auto fieldOfUnion = [](const std::vector<Bounds>& boxes, float voxelSize) {
        std::vector<Mesh> parts;
        for (const Bounds& box : boxes) parts.push_back(shapes::moved(shapes::box(0.5f * box.size()), box.centre()));
        return build(shapes::join(parts), {.voxelSize = voxelSize, .unite = true});
    };
    SECTION("as a formula says") {
        const std::vector<Bounds> boxes{{glm::vec3(-0.5f), glm::vec3(0.5f)}, {glm::vec3(-0.25f), glm::vec3(0.75f)}};
        const double volume = 2 - 0.75 * 0.75 * 0.75;
        for (const float voxelSize : {0.039f, 0.0195f, 0.0125f}) {
            CAPTURE(voxelSize);
            CHECK(massProperties(fieldOfUnion(boxes, voxelSize)).volume == Approx(volume).epsilon(1e-3));
        }
    }
    SECTION("as the field of the union's own surface has it, where the lattice falls anyhow") {
        const unsigned randomSeed = seed();
        CAPTURE(randomSeed);
        std::mt19937 random(randomSeed);
        std::uniform_real_distribution<float> place(-0.5f, 0.5f), size(0.4f, 1);
        constexpr float voxelSize = 0.02f;
        for (int i = 0; i < 20; ++i) {
            CAPTURE(i);
            std::vector<Bounds> boxes;
            // no field resolves slots and fins narrower than two voxels
            do {
                boxes.clear();
                for (int k = 2 + i % 3; k > 0; --k) {
                    const glm::vec3 lower(place(random), place(random), place(random));
                    boxes.push_back({lower, lower + glm::vec3(size(random), size(random), size(random))});
                }
            } while (smallestStep(boxes) < 2 * voxelSize);
            const LevelSet field = fieldOfUnion(boxes, voxelSize);
            CAPTURE(field.signReason());
            const Mesh surface = surfaceOfUnion(boxes);
            const double volume = massProperties(field).volume;
            CHECK(volume == Approx(massProperties(build(surface, {.voxelSize = voxelSize})).volume).epsilon(1e-4));
            // trilinear samples round an edge by less than a tenth of a square voxel
            const double rounded = 0.1 * double(voxelSize) * double(voxelSize) * sharpEdgeLength(surface);
            CHECK(volume == Approx(massProperties(surface).volume).margin(rounded));
        }
    }
}

TEST_CASE("a body of overlapping solids has the mass of their union, at any voxel size") {
    const unsigned randomSeed = seed();
    CAPTURE(randomSeed);
    Random random(randomSeed);
    // bars whose ends stand out of each other
    const std::vector<Bounds> bars{{glm::vec3(-1, -0.1f, -0.1f), glm::vec3(1, 0.1f, 0.1f)},
                                   {glm::vec3(-0.1f, -1, -0.1f), glm::vec3(0.1f, 1, 0.1f)},
                                   {glm::vec3(-0.1f, -0.1f, -0.6f), glm::vec3(0.12f, 0.15f, 1)}};
    std::vector<Mesh> parts;
    for (const Bounds& bar : bars) parts.push_back(shapes::moved(shapes::box(0.5f * bar.size()), bar.centre()));
    const bool unites = GENERATE(true, false);
    CAPTURE(unites);
    for (const int resolution : {32, 64, 128}) {
        CAPTURE(resolution);
        const glm::mat4 motion = randomMotion(random);
        const Mesh mesh = transformed(shapes::join(parts), motion);
        const LevelSet field = build(mesh, {.voxelSize = voxelSizeFor(mesh, resolution), .unite = unites});
        const Mesh truth = transformed(surfaceOfUnion(bars), motion);
        requireMass(Collider(mesh, field).mass(), massProperties(truth), 2e-6, 5);
    }
}

TEST_CASE("a body whose every face is there twice, back to back, weighs what one half of them holds") {
    const Mesh box = shapes::box({0.5f, 0.4f, 0.3f}, 2);
    const Mesh mesh = shapes::join({box, shapes::flipped(box)});
    const LevelSet field = build(mesh, {.voxelSize = 0.03f});
    CHECK(Collider(mesh, field).mass().volume == Approx(0.48).epsilon(1e-3));
}

TEST_CASE("a field without an inside has no mass") {
    const LevelSet none = withGrid(levelSetOf(sphereSolid(0.7), 0.05), [](openvdb::FloatGrid& grid) {
        for (auto value = grid.beginValueAll(); value; ++value) value.setValue(std::abs(*value));
    });
    REQUIRE_THROWS_AS(massProperties(none), std::invalid_argument);
}

TEST_CASE("the mass of a field has the same bytes for any number of threads") {
    const LevelSet field = levelSetOf(torusSolid(1, 0.3), 0.02);
    const auto with = [&](std::size_t threads) {
        const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
        return massProperties(field);
    };
    const MassProperties one = with(1);
    const std::size_t bytes = offsetof(MassProperties, principalAxes) + sizeof one.principalAxes;  // padding follows
    for (const std::size_t threads : {2, 4}) {
        const MassProperties more = with(threads);
        CHECK(std::memcmp(&one, &more, bytes) == 0);
    }
}
}  // namespace bilayer::mass_test
