// SPDX-License-Identifier: Apache-2.0
// The exact method against the ground truth: every distance, every sign, the whole band, over the public meshes and
// over shapes on which other builders fail. `bench_accuracy` does the same with more voxels.
#include <oneapi/tbb/global_control.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <random>

#include <bilayer/sdf/build.h>
#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/mesh_io.h>
#include "demos/shared/shapes.h"
#include "sdf/base/exact_error.h"
#include "sdf/base/openvdb.h"
#include "sdf/leaf/band.h"
#include "tests/support/clean.h"
#include "tests/support/support.h"
#include "tests/support/truth.h"
#include "tests/support/verdict.h"

namespace bilayer::exact_test {
namespace {

constexpr std::size_t manyVoxels = 30000;  // active voxels checked per shape; smaller grids are checked completely

using Random = std::mt19937;

float uniform(Random& random, float low, float high) {
    return std::uniform_real_distribution<float>(low, high)(random);
}

openvdb::FloatGrid::ConstPtr exactGrid(const Mesh& mesh, float voxelSize, const test::Band& band, int threads = 0) {
    return build(mesh, {.voxelSize = voxelSize,
                        .exteriorWidthVoxels = float(band.exterior),
                        .interiorWidthVoxels = float(band.interior),
                        .method = Method::exact,
                        .threads = threads})
        .grids()
        .distance;
}

// Builds a field of `mesh` and compares it with the ground truth of `like`.
void checkExact(const Mesh& mesh, const Mesh& like, float voxelSize, const test::Band& band, unsigned seed,
                std::size_t count = manyVoxels) {
    const auto grid = exactGrid(mesh, voxelSize, band);
    const auto voxels =
        test::trueVoxels(test::Truth(like), test::chooseVoxels(*grid, like, band, count, seed), grid->voxelSize()[0]);
    const test::Verdict verdict = test::judge(*grid, band, voxels);
    std::string faults;
    for (const test::Witness& witness : verdict.witnesses) faults += "\n  " + witness.text();
    INFO(voxelSize << " m, band " << band.exterior << "/" << band.interior << ", " << verdict.active << " of "
                   << verdict.checked << " voxels active; inexact " << verdict.inexact << " (worst " << verdict.worst
                   << "), wrong " << verdict.wrong << ", in the background " << verdict.wrongBackground << ", missing "
                   << verdict.missing << ", extra " << verdict.extra << faults);
    CHECK(verdict.active > 0);
    CHECK(verdict.exact());
    std::size_t outsiders = 0;  // inactive voxels hold the width of their side
    for (auto value = grid->cbeginValueOff(); value; ++value)
        outsiders += *value != float(band.exterior) * voxelSize && *value != -float(band.interior) * voxelSize;
    CHECK(outsiders == 0);
}

void checkExact(const Mesh& mesh, float voxelSize, const test::Band& band, unsigned seed,
                std::size_t count = manyVoxels) {
    checkExact(mesh, mesh, voxelSize, band, seed, count);
}

// No width is 0.5: all faces of a cube may lie half-way between voxels, with no voxel in the band.
test::Band anyBand(Random& random) {
    const test::Band bands[] = {{3, 3}, {1, 1}, {5, 2}, {1, 4}, {0.6, 0.6}, {2.25, 3.5}, {10, 10}};
    return bands[random() % std::size(bands)];
}

// A random rotation, and a translation of less than a metre.
Mesh anyPose(const Mesh& mesh, Random& random) {
    const glm::vec3 axis(uniform(random, -1, 1), uniform(random, -1, 1), 1.5f);
    const glm::vec3 shift(uniform(random, -1, 1), uniform(random, -1, 1), uniform(random, -1, 1));
    const glm::mat4 rotation = glm::rotate(glm::mat4(1), uniform(random, 0, 6.28f), glm::normalize(axis));
    return transformed(mesh, glm::translate(glm::mat4(1), shift) * rotation);
}

// A wedge whose edge, along y at the origin, is `thickness` wide one metre away.
Mesh wedge(float thickness) {
    const float z = thickness / 2;
    return {{{0, -1, 0}, {0, 1, 0}, {1, -1, z}, {1, 1, z}, {1, -1, -z}, {1, 1, -z}},
            {{0, 2, 3}, {0, 3, 1}, {0, 5, 4}, {0, 1, 5}, {2, 5, 3}, {2, 4, 5}, {0, 4, 2}, {1, 3, 5}}};
}

// A star of needles around the origin, with valleys between them: hard vertices for pseudonormals.
Mesh star(Random& random) {
    Mesh mesh = shapes::sphere(1, 2);
    for (auto& p : mesh.points) p *= random() % 3 == 0 ? uniform(random, 0.05f, 0.2f) : uniform(random, 0.5f, 1);
    return mesh;
}

// A surface of slivers: a cylinder and a cone whose side triangles are far narrower than a voxel.
Mesh slivers() {
    return shapes::join({shapes::cylinder(0.3f, 2, 800), shapes::moved(shapes::cone(0.4f, 2, 500), {1, 0, 0})});
}

// Splits one edge of some triangles at its midpoint on one side only. A triangle without area closes the crack.
Mesh withZeroArea(const Mesh& mesh, int every) {
    Mesh result = mesh;
    for (std::size_t i = 0; i < mesh.triangles.size(); i += std::size_t(every)) {
        const glm::uvec3 t = mesh.triangles[i];
        const unsigned middle = unsigned(result.points.size());
        result.points.push_back(0.5f * (mesh.points[t.x] + mesh.points[t.y]));
        result.triangles[i] = {t.x, middle, t.z};
        result.triangles.push_back({middle, t.y, t.z});
        result.triangles.push_back({t.x, t.y, middle});
    }
    return result;
}

// Rounds coordinates to values that single precision adds and halves exactly.
Mesh onBinaryFractions(Mesh mesh, float step = 1.f / 1024) {
    for (auto& p : mesh.points) p = glm::round(p / step) * step;
    return weld(mesh);
}

bool sameBytes(const openvdb::FloatGrid& a, const openvdb::FloatGrid& b) {
    if (!a.tree().hasSameTopology(b.tree()) || a.background() != b.background()) return false;
    auto other = b.cbeginValueAll();
    for (auto value = a.cbeginValueAll(); value; ++value, ++other) {
        const float x = *value, y = *other;
        if (std::memcmp(&x, &y, sizeof x) != 0 || value.getCoord() != other.getCoord()) return false;
    }
    return !other;
}

Mesh shuffled(Mesh mesh, Random& random) {
    std::shuffle(mesh.triangles.begin(), mesh.triangles.end(), random);
    return mesh;
}

// Meshes for the properties, on binary fractions: a knot, a box of large triangles, needles.
std::vector<Mesh> propertyMeshes(Random& random) {
    return {onBinaryFractions(shapes::torusKnot(2, 3, 1, 0.2f, 200, 16)),
            onBinaryFractions(shapes::box({0.9f, 0.6f, 0.3f})), onBinaryFractions(star(random))};
}

}  // namespace

TEST_CASE("the ground truth is that of sums over all triangles, also in line with edges and vertices") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const Mesh nested =
        shapes::join({shapes::sphere(1, 2), shapes::flipped(shapes::sphere(0.6f, 2)), shapes::sphere(0.3f, 1)});
    for (const Mesh& mesh : {nested, wedge(1e-4f), star(random), withZeroArea(shapes::box({1, 0.5f, 0.25f}, 2), 3),
                             anyPose(shapes::cylinder(0.5f, 1, 200), random), shapes::box({1, 1, 1}, 4)}) {
        const test::Truth truth(mesh);
        for (int i = 0; i < 300; ++i) {
            glm::dvec3 p(uniform(random, -1.5f, 1.5f), uniform(random, -1.5f, 1.5f), uniform(random, -1.5f, 1.5f));
            // rays through vertices, and within walls
            const glm::dvec3 vertex(mesh.points[random() % mesh.points.size()]);
            if (i % 3 == 1) p = {vertex.x, vertex.y, p.z};
            if (i % 3 == 2) p = {vertex.x, p.y, p.z};
            const double distance = test::distance(mesh, p);
            CAPTURE(p.x, p.y, p.z, distance);
            REQUIRE(truth.distance(p) == Approx(distance).margin(1e-12));
            if (distance > 1e-6) REQUIRE(truth.winding(p) == int(std::lround(test::windingNumber(mesh, p))));
        }
    }
}

TEST_CASE("exact: every clean public mesh, at some resolution and band") {
    const unsigned seed = test::seed();
    Random random(seed);
    const std::vector<std::string> names = test::cleanMeshes();
    if (names.empty()) WARN("skipped: the corpus is not here");
    for (const std::string& name : names) {
        const auto path = test::corpusMesh(name);
        if (!path) return;
        const Mesh mesh = readMesh(*path);
        const float resolution = std::round(uniform(random, 12, 60));
        CAPTURE(seed, name, resolution);
        checkExact(mesh, voxelSizeFor(mesh, resolution), anyBand(random), random(), 10000);
    }
}

TEST_CASE("exact: sharp edges, needles and slivers") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    SECTION("a wedge sharper than any voxel") {
        checkExact(anyPose(wedge(0.01f), random), 0.03f, {3, 3}, seed);
    }
    SECTION("a blade") {
        checkExact(anyPose(wedge(1e-5f), random), 0.05f, anyBand(random), seed);
    }
    SECTION("needles and valleys") {
        checkExact(anyPose(star(random), random), 0.04f, anyBand(random), seed);
    }
    SECTION("one needle") {
        checkExact(anyPose(shapes::cone(0.005f, 2, 24), random), 0.03f, {3, 3}, seed);
    }
    SECTION("slivers") {
        checkExact(anyPose(slivers(), random), 0.03f, anyBand(random), seed);
    }
    SECTION("a sphere of triangles far smaller than a voxel") {
        checkExact(anyPose(shapes::sphere(1, 6), random), 0.2f, anyBand(random), seed);
    }
}

TEST_CASE("exact: walls and gaps thinner than a voxel") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const float h = 0.05f;
    for (const float wall : {0.7f * h, 0.1f * h, 0.001f * h}) {
        CAPTURE(wall);
        const Mesh plate = shapes::box({1, 0.7f, wall / 2});
        checkExact(anyPose(plate, random), h, anyBand(random), seed);
        // two plates a wall thickness apart: four surfaces within a voxel
        checkExact(anyPose(shapes::join({plate, shapes::moved(plate, {0.1f, 0.05f, 2 * wall})}), random), h, {3, 3},
                   seed);
        checkExact(anyPose(shapes::bowl(1, std::max(wall, 0.005f), 48), random), h, {3, 3}, seed);
        // a shell whose cavity almost fills it
        const Mesh inside = shapes::flipped(shapes::box(glm::vec3(0.5f, 0.4f, 0.3f) - wall));
        checkExact(anyPose(shapes::join({shapes::box({0.5f, 0.4f, 0.3f}), inside}), random), h, {3, 3}, seed);
    }
}

TEST_CASE("exact: a plate in the plane of voxel centres, and one between them") {
    for (const float offset : {0.f, 0.5f, 0.25f}) {
        CAPTURE(offset);
        const Mesh plate = shapes::moved(shapes::box({1, 1, 1.f / 64}), {0, 0, offset / 32});
        checkExact(plate, 1.f / 32, {3, 3}, 1);
    }
}

TEST_CASE("exact: a box of 12 triangles, a thousand voxels long") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    checkExact(anyPose(shapes::box({1, 0.3f, 0.1f}), random), 0.002f, {1, 1}, seed);
}

TEST_CASE("exact: triangles without area and duplicate triangles") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (const Mesh& mesh : {onBinaryFractions(shapes::sphere(1, 3)), shapes::box({1, 0.5f, 0.25f}, 4)}) {
        checkExact(withZeroArea(mesh, 5), mesh, 0.05f, {3, 3}, seed);
        Mesh twice = mesh;
        for (std::size_t i = 0; i < mesh.triangles.size(); i += 7) {
            const glm::uvec3 t = mesh.triangles[i];
            twice.triangles.push_back({t.y, t.z, t.x});
            twice.triangles.push_back({t.x, t.x, t.y});
        }
        checkExact(shuffled(twice, random), mesh, 0.05f, {3, 3}, seed);
    }
}

TEST_CASE("exact: vertices that are not welded") {
    const Mesh mesh = shapes::torusKnot(2, 3, 1, 0.2f, 200, 16);
    Mesh soup;
    for (const auto& t : mesh.triangles) {
        const unsigned first = unsigned(soup.points.size());
        for (int i = 0; i < 3; ++i) soup.points.push_back(mesh.points[t[i]]);
        soup.triangles.push_back({first, first + 1, first + 2});
    }
    checkExact(soup, mesh, 0.04f, {3, 3}, 1);
}

TEST_CASE("exact: nested cavities and components that touch") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const float h = 0.05f;
    const Mesh box = shapes::box({0.5f, 0.5f, 0.5f});
    SECTION("four shells, one in another") {
        const Mesh nested = shapes::join({shapes::sphere(1, 4), shapes::flipped(shapes::sphere(0.7f, 3)),
                                          shapes::sphere(0.5f, 3), shapes::flipped(shapes::sphere(0.2f, 2))});
        for (int i = 0; i < 3; ++i) checkExact(anyPose(nested, random), h, anyBand(random), seed);
    }
    SECTION("at a vertex") {
        checkExact(anyPose(shapes::join({box, shapes::moved(box, {1, 1, 1})}), random), h, {3, 3}, seed);
    }
    SECTION("at an edge") {
        checkExact(anyPose(shapes::join({box, shapes::moved(box, {1, 1, 0})}), random), h, {3, 3}, seed);
    }
    SECTION("at the half of an edge") {
        checkExact(shapes::join({box, shapes::moved(box, {1, 1, 0.5f})}), h, {3, 3}, seed);
    }
    SECTION("with a thousandth of a voxel between two faces") {
        checkExact(anyPose(shapes::join({box, shapes::moved(box, {1 + 1e-3f * h, 0.3f, 0.2f})}), random), h, {3, 3},
                   seed);
    }
    SECTION("in a cavity that touches the hull at a vertex") {
        // a box compressed towards the diagonal through the hull's corner, so that it does not touch the hull's faces
        const glm::vec3 diagonal = glm::normalize(glm::vec3(1));
        const glm::mat3 squeeze = 0.2f * glm::mat3(1) + 0.3f * glm::outerProduct(diagonal, diagonal);
        Mesh hole = shapes::flipped(box);
        for (auto& p : hole.points) p = p == glm::vec3(0.5f) ? p : 0.5f + squeeze * (p - 0.5f);
        checkExact(anyPose(shapes::join({box, hole}), random), h, {3, 3}, seed);
    }
}

TEST_CASE("exact: far from the origin, and smaller than a voxel") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const Mesh far = weld(shapes::moved(shapes::sphere(0.5f, 3), {1e4f, -1e4f, 1e4f}));
    checkExact(far, 0.01f, {3, 3}, seed);
    checkExact(weld(shapes::moved(shapes::box({0.5f, 0.25f, 0.125f}), {-1e4f, 1e4f, 1e4f})), 0.01f, {5, 2}, seed);
    for (int i = 0; i < 5; ++i) {
        const Mesh tiny = anyPose(shapes::sphere(0.4f * std::pow(0.1f, float(i)), 2), random);
        checkExact(tiny, 1, {double(1 + i), 1}, seed);  // narrower bands may contain no voxel
    }
}

TEST_CASE("exact: triangles and edges so short that floats do not hold their squares") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const auto any = [&] { return glm::vec3(uniform(random, -1, 1), uniform(random, -1, 1), uniform(random, -1, 1)); };
    for (int round = 0; round < 300; ++round) {
        const float leg = std::pow(10.f, uniform(random, -36, -4)), other = std::pow(10.f, uniform(random, -36, 1));
        // a point, a segment or a triangle relative to a voxel, at the origin: only there do floats distinguish its
        // vertices
        const Mesh mesh{{{0, 0, 0}, leg * any(), other * any()}, {{0, 1, 2}}};
        if (!(glm::length(glm::cross(glm::dvec3(mesh.points[1]), glm::dvec3(mesh.points[2]))) > 0)) continue;
        for (const Method method : {Method::exact, Method::pseudonormal}) {
            const auto field = build(mesh, {.voxelSize = 1, .method = method, .sign = Sign::winding});
            double worst = 0;
            for (auto voxel = field.grids().distance->cbeginValueOn(); voxel; ++voxel) {
                const openvdb::Coord at = voxel.getCoord();
                const double distance = test::distance(mesh, glm::dvec3(at.x(), at.y(), at.z()));
                worst = std::max(worst, std::abs(std::abs(double(*voxel)) - distance));
            }
            CAPTURE(round, leg, other, method);
            CHECK(field.activeVoxels() > 80);
            CHECK(worst < test::exactness);
        }
    }
}

TEST_CASE("exact: bytes do not depend on the order of triangles or the number of threads") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (const Mesh& mesh : propertyMeshes(random)) {
        const test::Band band = anyBand(random);
        const auto grid = exactGrid(mesh, 0.03f, band, 1);
        for (const int threads : {2, 4}) CHECK(sameBytes(*grid, *exactGrid(mesh, 0.03f, band, threads)));
        for (int i = 0; i < 2; ++i) CHECK(sameBytes(*grid, *exactGrid(shuffled(mesh, random), 0.03f, band)));
    }
}

TEST_CASE("exact: a shift by whole voxels keeps the values") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (const Mesh& mesh : propertyMeshes(random))
        for (const glm::ivec3 shift : {glm::ivec3(1, 0, 0), glm::ivec3(13, -7, 5), glm::ivec3(64, 128, -64)}) {
            const auto here = exactGrid(mesh, 1.f / 32, {3, 2});
            const auto there = exactGrid(shapes::moved(mesh, glm::vec3(shift) / 32.f), 1.f / 32, {3, 2});
            const auto values = there->getConstAccessor();
            std::size_t differ = here->activeVoxelCount() != there->activeVoxelCount();
            for (auto voxel = here->cbeginValueOn(); voxel; ++voxel)
                differ += values.getValue(voxel.getCoord() + openvdb::Coord(shift.x, shift.y, shift.z)) != *voxel;
            CAPTURE(shift.x, shift.y, shift.z);
            CHECK(differ == 0);
        }
}

TEST_CASE("exact: a rotation by 90 degrees keeps the distances within float rounding, and the signs") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const float h = 1.f / 32, width = 3, rounding = 1e-5f;  // the last two in voxels
    for (const Mesh& mesh : propertyMeshes(random)) {
        Mesh turned = mesh;
        for (auto& p : turned.points) p = {-p.y, p.x, p.z};
        const auto here = exactGrid(mesh, h, {3, 3}), there = exactGrid(turned, h, {3, 3});
        const auto values = there->getConstAccessor();
        double worst = 0;
        std::size_t lost = 0, turnedSigns = 0;
        for (auto voxel = here->cbeginValueOn(); voxel; ++voxel) {
            const openvdb::Coord at = voxel.getCoord(), to(-at.y(), at.x(), at.z());
            const double distance = std::abs(*voxel / h), other = values.getValue(to) / h;
            turnedSigns += distance > detail::exactError && (other < 0) != (*voxel < 0);
            // A voxel at the edge of the band may be within it in one grid, and outside it in the other.
            if (distance > width - detail::bandEdge - rounding) continue;
            worst = std::max(worst, std::abs(std::abs(other) - distance));
            lost += !values.isValueOn(to);
        }
        CHECK(worst <= rounding);
        CHECK(lost == 0);
        CHECK(turnedSigns == 0);
    }
}
}  // namespace bilayer::exact_test
