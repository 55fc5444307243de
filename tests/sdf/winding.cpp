// SPDX-License-Identifier: Apache-2.0
#include "sdf/sign/winding.h"

#include <oneapi/tbb/parallel_for.h>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <random>

#include <bilayer/sdf/build.h>
#include <bilayer/sdf/inspect.h>
#include <bilayer/sdf/mesh_io.h>
#include "demos/shared/shapes.h"
#include "sdf/base/openvdb.h"
#include "sdf/bvh/winding_in_ball.h"
#include "sdf/bvh/winding_number.h"
#include "tests/sdf/unsigned_band.h"
#include "tests/support/support.h"

namespace bilayer::winding_test {
using namespace bilayer::detail;

namespace {

// Within this distance of 0.5, rounding may decide the winding number [1].
constexpr double undecided = 1e-9;

// The mesh without the triangles whose centre satisfies `gone`.
template <class Gone>
Mesh without(const Mesh& mesh, const Gone& gone) {
    Mesh rest{mesh.points, {}};
    for (const auto& t : mesh.triangles)
        if (!gone((mesh.points[t.x] + mesh.points[t.y] + mesh.points[t.z]) / 3.f)) rest.triangles.push_back(t);
    return rest;
}

Mesh soup(const glm::vec3& extent, int triangles, unsigned seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> uniform(-1, 1);
    const auto point = [&] { return glm::vec3(uniform(random), uniform(random), uniform(random)); };
    Mesh mesh;
    for (int i = 0; i < triangles; ++i) {
        const glm::vec3 centre = extent * point();
        for (int k = 0; k < 3; ++k) mesh.points.push_back(centre + 0.3f * point());
        mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
    }
    return mesh;
}

struct Field {
    openvdb::FloatGrid::Ptr distances, field;
    BandWidths widths;
};

Field signedField(const Mesh& mesh, float h, bool closed, float exterior = 3, float interior = 2) {
    Field result{test::unsignedBand(mesh, h, std::max(exterior, interior)), nullptr, {exterior, interior, h}};
    result.field = result.distances->deepCopy();
    signByWinding(*result.field, mesh, result.widths, closed);
    CHECK(test::fault(*result.field, *result.distances, result.widths) == "");
    return result;
}

// Voxels in and around the box of the band, both near the surface and far from it.
std::vector<openvdb::Coord> voxelsOf(const openvdb::FloatGrid& distances, std::size_t count, unsigned seed) {
    std::mt19937 random(seed);
    std::vector<openvdb::Coord> voxels;
    const std::size_t every = std::max<std::size_t>(1, 2 * distances.activeVoxelCount() / count);
    std::size_t i = random() % every;
    for (auto value = distances.cbeginValueOn(); value; ++value)
        if (i++ % every == 0) voxels.push_back(value.getCoord());
    const openvdb::CoordBBox box = distances.evalActiveVoxelBoundingBox();
    for (std::size_t n = 0; n < count / 2; ++n) {
        openvdb::Coord at;
        for (int axis = 0; axis < 3; ++axis)
            at[axis] = std::uniform_int_distribution<int>(box.min()[axis] - 8, box.max()[axis] + 8)(random);
        voxels.push_back(at);
    }
    return voxels;
}

// Counts voxels whose sign differs from brute force at `at(voxel)`.
template <class At>
std::size_t wrongSigns(const openvdb::FloatGrid& field, const Mesh& mesh, const std::vector<openvdb::Coord>& voxels,
                       const At& at) {
    std::vector<char> wrong(voxels.size());
    const auto values = field.getConstAccessor();
    std::vector<bool> inside;
    for (const openvdb::Coord& voxel : voxels) inside.push_back(std::signbit(values.getValue(voxel)));
    const double h = field.voxelSize()[0];
    tbb::parallel_for(std::size_t(0), voxels.size(), [&](std::size_t v) {
        const openvdb::Vec3d p = at(voxels[v]) * h;
        const double w = test::windingNumber(mesh, {p.x(), p.y(), p.z()});
        wrong[v] = inside[v] != (w > 0.5) && std::abs(w - 0.5) > undecided;
    });
    return std::size_t(std::count(wrong.begin(), wrong.end(), 1));
}

// In leaves each voxel has its own sign; elsewhere all voxels of a leaf-sized block of an open mesh have the sign of
// its centre.
std::size_t wrongSigns(const Field& f, const Mesh& mesh, bool closed, std::size_t count, unsigned seed) {
    std::vector<openvdb::Coord> voxels = voxelsOf(*f.distances, count, seed);
    // on the surface itself, both sides are right
    std::erase_if(voxels, [&](const openvdb::Coord& voxel) { return f.distances->tree().getValue(voxel) == 0; });
    return wrongSigns(*f.field, mesh, voxels, [&](const openvdb::Coord& voxel) {
        if (closed || f.distances->tree().probeConstLeaf(voxel)) return voxel.asVec3d();
        return openvdb::Vec3d(voxel.x() & ~7, voxel.y() & ~7, voxel.z() & ~7) + 3.5;
    });
}

}  // namespace

TEST_CASE("the winding number is on the side of a half that brute force finds") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> uniform(-1.3, 1.3);
    const Mesh sphere = shapes::sphere(1, 4);
    for (const Mesh& mesh : {sphere, without(sphere, [](const glm::vec3& p) { return p.z > 0.3f; }),
                             soup(glm::vec3(0.5f), 3000, seed), shapes::box({1, 0.5f, 0.01f}, 3)}) {
        const WindingNumber winding(mesh);
        for (int i = 0; i < 3000; ++i) {
            glm::dvec3 p(uniform(random), uniform(random), uniform(random));
            if (i % 3 == 0)  // very near the surface
                p = glm::dvec3(mesh.points[random() % mesh.points.size()]) + 1e-4 * p;
            const double exact = test::windingNumber(mesh, p);
            const auto estimate = winding.estimate(p, i % 2 ? 1.0 : 0.01);
            CAPTURE(p.x, p.y, p.z, exact, estimate.value, estimate.error);
            REQUIRE(std::abs(estimate.value - exact) <= estimate.error + 1e-10);
            if (std::abs(exact - 0.5) <= undecided) continue;
            REQUIRE((estimate.value > 0.5) == (exact > 0.5));
            REQUIRE(winding.isInside(p) == (exact > 0.5));
        }
    }
}

TEST_CASE("the winding number in a ball is that of brute force within its bound") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> uniform(-1.3, 1.3), unit(0, 1);
    const Mesh sphere = shapes::sphere(1, 4);
    for (const Mesh& mesh : {sphere, without(sphere, [](const glm::vec3& p) { return p.z > 0.3f; }),
                             soup(glm::vec3(0.5f), 3000, seed), shapes::box({1, 0.5f, 0.01f}, 3)}) {
        const WindingNumber winding(mesh);
        int decided = 0;
        double bounds = 0;
        for (int i = 0; i < 200; ++i) {
            const glm::dvec3 centre(uniform(random), uniform(random), uniform(random));
            const double radius = std::pow(10, -3 * unit(random));
            const WindingInBall inBall(winding, centre, radius);
            for (int j = 0; j < 10; ++j) {
                const glm::dvec3 direction(uniform(random), uniform(random), uniform(random));
                const glm::dvec3 p = centre + unit(random) * radius * glm::normalize(direction);
                const double exact = test::windingNumber(mesh, p);
                const auto estimate = inBall.estimate(p);
                CAPTURE(p.x, p.y, p.z, radius, exact, estimate.value, estimate.error);
                REQUIRE(std::abs(estimate.value - exact) <= estimate.error + 1e-10);
                const auto coarse = inBall.coarseEstimate(p);
                REQUIRE(std::abs(coarse.value - exact) <= coarse.error + 1e-10);
                REQUIRE(coarse.error > estimate.error - 1e-10);
                decided += estimate.error < std::abs(estimate.value - 0.5);
                bounds += estimate.error / 2000;
            }
        }
        CHECK(decided > 1800);  // of 2000 sides
        CHECK(bounds < 0.2);
    }
}

TEST_CASE("the winding number in a ball is unknown on triangles and on edges between them") {
    const Mesh square{{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}, {{0, 1, 2}, {0, 2, 3}}};
    const WindingNumber winding(square);
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    std::uniform_int_distribution<int> hundredths(1, 99);
    for (int i = 1; i < 100; ++i)
        for (const glm::dvec2 at : {glm::dvec2(i, i), glm::dvec2(i, hundredths(random))}) {
            const glm::dvec3 p(at / 100.0, 0);
            CAPTURE(p.x, p.y);
            REQUIRE(WindingInBall(winding, p, 0.01).estimate(p).error >= 0.5);
            REQUIRE(WindingInBall(winding, p, 0.01).coarseEstimate(p).error >= 0.5);
        }
}

TEST_CASE("the expansion about a far cluster is of second order") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    const Mesh mesh = soup({1, 0.7f, 0.4f}, 60, seed);
    const WindingNumber winding(mesh);
    double near = 0, far = 0, nearInBall = 0, farInBall = 0;
    for (int i = 0; i < 100; ++i) {
        const glm::dvec3 direction = glm::normalize(glm::dvec3(normal(random), normal(random), normal(random)));
        const glm::dvec3 offset = glm::normalize(glm::dvec3(normal(random), normal(random), normal(random)));
        const auto check = [&](double distance, double& error, double& errorInBall) {
            const glm::dvec3 p = distance * direction;
            const double exact = test::windingNumber(mesh, p);
            error = std::max(error, std::abs(winding(p) - exact));
            errorInBall =
                std::max(errorInBall, std::abs(WindingInBall(winding, p + offset, 1).estimate(p).value - exact));
        };
        check(40, near, nearInBall);
        check(80, far, farInBall);
    }
    CAPTURE(near, far, nearInBall, farInBall);
    // the first omitted term falls with the fifth power of the distance
    CHECK(far > 0);
    CHECK(near / far > 28);
    CHECK(near / far < 37);
    CHECK(farInBall > 0);
    CHECK(nearInBall / farInBall > 28);
    CHECK(nearInBall / farInBall < 37);
}

TEST_CASE("a point in the opening of a hemisphere sees half of all directions up to its own precision") {
    // there the winding number is 0.5 to within 1e-6 or less: only the exact sum over triangles decides
    const Mesh half = without(shapes::sphere(1, 5), [](const glm::vec3& p) { return p.z > 0; });
    const WindingNumber winding(half);
    for (double height = 1e-3; height > 1e-8; height /= 10)
        for (const double z : {height, -height}) {
            const double exact = test::windingNumber(half, {0.1, 0.2, z});
            CAPTURE(z, exact);
            CHECK((winding({0.1, 0.2, z}) > 0.5) == (exact > 0.5));
            CHECK(winding.isInside({0.1, 0.2, z}) == (exact > 0.5));
        }
}

TEST_CASE("closed meshes get the signs of brute force in every voxel") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    const Mesh ball = shapes::sphere(1, 3);
    // nested shells count twice inside; a cavity does not count; overlapping boxes count as their union
    const std::vector<Mesh> meshes{ball,
                                   shapes::join({ball, shapes::sphere(0.5f, 3)}),
                                   shapes::join({ball, shapes::flipped(shapes::sphere(0.5f, 3))}),
                                   shapes::join({shapes::box({0.5f, 0.4f, 0.3f}),
                                                 shapes::moved(shapes::box({0.5f, 0.4f, 0.3f}), {0.3f, 0.3f, 0.2f})}),
                                   shapes::box({1, 1, 0.013f}),
                                   shapes::flipped(ball),
                                   shapes::torus(1, 0.3f)};
    for (std::size_t m = 0; m < meshes.size(); ++m)
        for (const float h : {0.05f, 0.21f}) {
            const Field f = signedField(meshes[m], h, true);
            CAPTURE(m, h);
            CHECK(wrongSigns(f, meshes[m], true, 5000, seed) == 0);
            CHECK(wrongSigns(signedField(meshes[m], h, false), meshes[m], true, 1500, seed) == 0);
        }
}

TEST_CASE("open meshes get the signs of brute force in every voxel of a leaf and every block between") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    const Mesh ball = shapes::sphere(1, 3);
    const std::vector<Mesh> meshes{
        without(ball, [](const glm::vec3& p) { return p.z > 0.9f; }),
        without(ball, [](const glm::vec3& p) { return p.z > -0.2f; }),
        without(shapes::box({1, 0.8f, 0.6f}, 4), [](const glm::vec3& p) { return p.z > 0.59f; }),
        soup({1, 1, 0.2f}, 100, seed)};
    for (std::size_t m = 0; m < meshes.size(); ++m) {
        const Field f = signedField(meshes[m], 0.03f, false);
        CAPTURE(m);
        CHECK(wrongSigns(f, meshes[m], false, 12000, seed) == 0);
    }
}

TEST_CASE("signs change where the number passes a half slowly, amid the voxels of a leaf") {
    // a ball in the opening of a hemisphere adds leaves where only the opening separates inside from outside
    const Mesh half = without(shapes::sphere(1, 3), [](const glm::vec3& p) { return p.z > 0; });
    const Mesh mesh = shapes::join({half, shapes::moved(shapes::sphere(0.3f, 2), {0.1f, 0, 0})});
    const unsigned seed = test::seed();
    CAPTURE(seed);
    const Field f = signedField(mesh, 0.015f, false, 6, 6);
    CHECK(wrongSigns(f, mesh, false, 12000, seed) == 0);
}

TEST_CASE("meshes with random faces taken away get the signs of brute force") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    for (const double share : {0.02, 0.2, 0.6}) {
        std::bernoulli_distribution isGone(share);
        // walls of the box lie in the lattice, and so do the triangles that are missing
        for (const Mesh& whole : {shapes::box({0.75f, 0.5f, 0.25f}, 6), shapes::torus(1, 0.4f, 60, 30)}) {
            const Mesh mesh = without(whole, [&](const glm::vec3&) { return isGone(random); });
            const Field f = signedField(mesh, 1.f / 32, false);
            CAPTURE(share, whole.triangles.size());
            CHECK(wrongSigns(f, mesh, false, 6000, seed) == 0);
        }
    }
}

TEST_CASE("what a mesh of many sheets has inside may lie outside its box") {
    // ten hemispheres in one: their sum exceeds 0.5 far outside the opening
    const Mesh half = without(shapes::sphere(1, 3), [](const glm::vec3& p) { return p.z > 0; });
    const Mesh mesh = shapes::join(std::vector<Mesh>(10, half));
    const Field f = signedField(mesh, 0.02f, false);
    const auto values = f.field->getConstAccessor();
    for (const double z : {0.5, 1.0, 2.0}) {
        CAPTURE(z);
        const openvdb::Coord block(0, 0, int(z / 0.02) & ~7);
        const double height = 0.02 * (block.z() + 3.5);
        const bool inside = test::windingNumber(mesh, {0.07, 0.07, height}) > 0.5;
        CHECK((values.getValue(block) < 0) == inside);
    }
}

TEST_CASE("public meshes get the signs of brute force", "[corpus]") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    for (const char* name : {"bunny_zipper.ply", "cow.obj", "teapot.obj", "kiva_pod_lowres.stl", "beetle.obj",
                             "office_chair.obj", "many_small_holes.ply", "factory_gear_medium.ply"}) {
        const auto path = test::corpusMesh(name);
        if (!path) return;
        const Mesh mesh = readMesh(*path);
        const bool closed = inspect(mesh).closed() && inspect(mesh).misorientedEdges == 0;
        const Field f = signedField(mesh, voxelSizeFor(mesh, 48), closed);
        CAPTURE(name, closed);
        CHECK(wrongSigns(f, mesh, closed, 2000, seed) == 0);
    }
}

TEST_CASE("a thin band far apart in a huge box is signed without a walk through the box") {
    const Mesh ball = shapes::sphere(10, 2);
    const Mesh mesh = shapes::join({ball, shapes::moved(ball, {4e5f, -3e5f, 2e5f})});
    for (const bool closed : {true, false}) {
        const Field f = signedField(mesh, 1, closed);
        CHECK(f.field->getConstAccessor().getValue({0, 0, 0}) == -2);
        CHECK(f.field->getConstAccessor().getValue({400000, -300000, 200000}) == -2);
        CHECK(f.field->getConstAccessor().getValue({200000, -150000, 100000}) == 3);
    }
}

TEST_CASE("signs by winding number have the same bytes for any number of threads") {
    const Mesh mesh = without(shapes::sphere(1, 4), [](const glm::vec3& p) { return p.z > 0.8f; });
    const auto distances = test::unsignedBand(mesh, 0.02f, 3);
    CHECK(test::sameForAnyThreads(*distances, [&](openvdb::FloatGrid& grid) {
        signByWinding(grid, mesh, {3, 3, 0.02f}, false);
    }));
}
}  // namespace bilayer::winding_test
