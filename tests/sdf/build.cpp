// SPDX-License-Identifier: Apache-2.0
#include <bilayer/sdf/build.h>

#include <oneapi/tbb/parallel_for.h>
#include <openvdb/tools/Diagnostics.h>

#include <atomic>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <random>

#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/mesh_io.h>
#include "demos/shared/shapes.h"
#include "sdf/base/access.h"
#include "sdf/base/openvdb.h"
#include "sdf/leaf/blocks.h"
#include "tests/support/support.h"

namespace bilayer::build_test {
using namespace bilayer::detail;

namespace {

struct Errors {
    double worst = 0, mean = 0;  // [voxels]
    double wrongSign = 0;        // maximum true distance of a voxel of wrong sign [voxels]
    std::size_t count = 0;
};

// The field's error at all active voxels (or every nth) against the true signed distance.
template <class Truth>
Errors errors(const LevelSet& field, Truth truth, std::size_t every = 1) {
    std::vector<std::pair<glm::dvec3, float>> voxels;
    std::size_t i = 0;
    for (auto voxel = field.grids().distance->cbeginValueOn(); voxel; ++voxel)
        if (i++ % every == 0) {
            const openvdb::Vec3d p = field.grids().distance->indexToWorld(voxel.getCoord());
            voxels.emplace_back(glm::dvec3(p.x(), p.y(), p.z()), voxel.getValue());
        }
    std::vector<double> truths(voxels.size());
    tbb::parallel_for(std::size_t(0), voxels.size(), [&](std::size_t v) { truths[v] = truth(voxels[v].first); });
    Errors result;
    const double h = double(field.voxelSize());
    for (std::size_t v = 0; v < voxels.size(); ++v) {
        const double error = std::abs(double(voxels[v].second) - truths[v]) / h;
        result.worst = std::max(result.worst, error);
        result.mean += error;
        if ((double(voxels[v].second) < 0) != (truths[v] < 0))
            result.wrongSign = std::max(result.wrongSign, std::abs(truths[v]) / h);
    }
    result.count = voxels.size();
    result.mean /= double(voxels.size());
    return result;
}

}  // namespace

TEST_CASE("spheres, tori and boxes get their analytic distances within the method's error") {
    const auto sphere = [](const glm::dvec3& p) { return glm::length(p) - 1.0; };
    const auto torus = [](const glm::dvec3& p) {
        return glm::length(glm::dvec2(glm::length(glm::dvec2(p)) - 1.0, p.z)) - 0.3;
    };
    const auto box = [](const glm::dvec3& p) {
        const glm::dvec3 q = glm::abs(p) - glm::dvec3(1, 0.7, 0.4);
        return glm::length(glm::max(q, 0.0)) + std::min(0.0, std::max({q.x, q.y, q.z}));
    };
    // table 1 of the paper: maximum about 1.2 voxels, mean about 0.45; smaller here, since the band is complete
    for (const float resolution : {32.f, 64.f, 128.f}) {
        CAPTURE(resolution);
        for (const Mesh& mesh : {shapes::sphere(1, 6), shapes::torus(1, 0.3f, 400, 200)}) {
            const bool isTorus = bounds(mesh).size().z < 1;
            const LevelSet field = build(mesh, {.voxelSize = voxelSizeFor(mesh, resolution)});
            const Errors e = isTorus ? errors(field, torus) : errors(field, sphere);
            CAPTURE(isTorus, e.worst, e.mean, e.wrongSign, e.count);
            CHECK(e.worst < 0.6);
            CHECK(e.mean < 0.2);
            CHECK(e.wrongSign < 0.1);
        }
        const Mesh mesh = shapes::box({1, 0.7f, 0.4f});
        const Errors e = errors(build(mesh, {.voxelSize = voxelSizeFor(mesh, resolution)}), box);
        CAPTURE(e.worst, e.mean, e.wrongSign, e.count);
        // theorem 1: two thirds of the longest edge, which is 2 voxels for half a square of area epsilon
        CHECK(e.worst < 4.0 / 3);
        CHECK(e.mean < 0.25);
        CHECK(e.wrongSign < 0.7);
    }
}

TEST_CASE("public meshes get the distances that brute force finds") {
    for (const char* name : {"spot.obj", "duck.obj", "rocker-arm.obj", "armadillo_100k.ply", "TinyTorus.obj"}) {
        const auto path = test::corpusMesh(name);
        if (!path) return;
        const Mesh mesh = readMesh(*path);
        const LevelSet field = build(mesh, {.voxelSize = voxelSizeFor(mesh, 60)});
        const std::size_t every = std::max<std::size_t>(1, field.activeVoxels() / 2000);
        const Errors e = errors(
            field, [&](const glm::dvec3& p) { return test::signedDistance(mesh, p); }, every);
        CAPTURE(name, e.worst, e.mean, e.wrongSign, e.count);
        CHECK(e.worst < 1.6);
        CHECK(e.mean < 0.25);
        CHECK(e.wrongSign < 0.8);
    }
}

TEST_CASE("far voxels have the right sign, in cavities too") {
    const Mesh mesh =
        shapes::join({shapes::sphere(1, 4), shapes::flipped(shapes::sphere(0.6f, 4)), shapes::sphere(0.25f, 4),
                      shapes::moved(shapes::box({0.5f, 0.5f, 0.5f}), {3, 0, 0})});
    const auto truth = [](const glm::dvec3& p) {
        const double r = glm::length(p);
        const glm::dvec3 q = glm::abs(p - glm::dvec3(3, 0, 0)) - 0.5;
        const double cube = glm::length(glm::max(q, 0.0)) + std::min(0.0, std::max({q.x, q.y, q.z}));
        return std::min(cube, r < 0.4 ? r - 0.25 : std::max(r - 1, 0.6 - r));
    };
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> uniform(-1.5, 4.5);
    for (const float width : {0.3f, 0.5f, 1.f, 3.f, 6.f}) {
        const LevelSet field =
            build(mesh, {.voxelSize = 0.02f, .exteriorWidthVoxels = width, .interiorWidthVoxels = 1.f});
        const auto values = field.grids().distance->getConstAccessor();
        std::size_t wrong = 0;
        for (int i = 0; i < 20000; ++i) {
            const openvdb::Coord at =
                openvdb::Coord::round(openvdb::Vec3d(uniform(random), uniform(random) / 3, uniform(random) / 3) / 0.02);
            const glm::dvec3 p(0.02 * at.x(), 0.02 * at.y(), 0.02 * at.z());
            if (std::abs(truth(p)) < 0.02) continue;
            wrong += (values.getValue(at) < 0) != (truth(p) < 0);
        }
        CAPTURE(width);
        CHECK(wrong == 0);
    }
}

TEST_CASE("values outside the band are plus the exterior or minus the interior width, exactly") {
    const LevelSet field =
        build(shapes::torus(1, 0.3f), {.voxelSize = 0.02f, .exteriorWidthVoxels = 4, .interiorWidthVoxels = 2.5f});
    CHECK(field.exteriorWidth() == 4 * 0.02f);
    CHECK(field.interiorWidth() == 2.5f * 0.02f);
    std::size_t inside = 0;
    for (auto value = field.grids().distance->cbeginValueOff(); value; ++value) {
        REQUIRE((value.getValue() == field.exteriorWidth() || value.getValue() == -field.interiorWidth()));
        inside += value.getValue() < 0;
    }
    CHECK(inside > 0);
    for (auto value = field.grids().distance->cbeginValueOn(); value; ++value) {
        REQUIRE(value.getValue() < field.exteriorWidth());
        REQUIRE(value.getValue() > -field.interiorWidth());
        REQUIRE(value.isVoxelValue());
    }
}

TEST_CASE("Widths are stored in metres") {
    const LevelSet field =
        build(shapes::sphere(1, 4), {.voxelSize = 0.125f, .exteriorWidthVoxels = 4, .interiorWidthVoxels = 2.5f});
    CHECK(field.exteriorWidth() == 0.5f);
    CHECK(field.interiorWidth() == 0.3125f);
}

TEST_CASE("OpenVDB finds a level set in it") {
    for (const Mesh& mesh : {shapes::sphere(1, 5), shapes::torus(1, 0.4f, 200, 100)}) {
        const LevelSet field = build(mesh, {.voxelSize = voxelSizeFor(mesh, 100)});
        openvdb::tools::CheckLevelSet<openvdb::FloatGrid> check(*field.grids().distance);
        // up to the eighth check: the ninth requires gradients of length 1 within 0.5, which samples violate
        CHECK(check.check(8) == "");
        CHECK(field.grids().distance->getGridClass() == openvdb::GRID_LEVEL_SET);
        CHECK(field.grids().distance->getName() == "distance");
    }
}

TEST_CASE("a shift by whole blocks keeps the bytes") {
    Mesh mesh = shapes::torusKnot(2, 3, 1, 0.2f);
    for (auto& p : mesh.points) p = glm::round(p * 1024.f) / 1024.f;
    const LevelSet here = build(mesh, {.voxelSize = 1.f / 64});
    const glm::ivec3 shift(64 * 7, -64 * 5, 8 * 3);
    const LevelSet there = build(shapes::moved(mesh, glm::vec3(shift) / 64.f), {.voxelSize = 1.f / 64});
    CHECK(here.activeVoxels() == there.activeVoxels());
    const auto values = there.grids().distance->getConstAccessor();
    std::size_t differ = 0;
    for (auto value = here.grids().distance->cbeginValueOn(); value; ++value)
        differ += values.getValue(value.getCoord() + openvdb::Coord(shift.x, shift.y, shift.z)) != value.getValue();
    CHECK(differ == 0);
}

TEST_CASE("nothing shows where blocks and bricks meet") {
    // a plane of the cylinder's side crosses many leaf borders; shifted by a fraction of a voxel, all its errors stay
    // small
    const auto truth = [](const glm::dvec3& p) { return glm::length(p) - 1.0; };
    const LevelSet field = build(shapes::sphere(1, 6), {.voxelSize = 1.f / 64});
    double atBorder = 0, elsewhere = 0;
    std::size_t countBorder = 0, countElsewhere = 0;
    for (auto voxel = field.grids().distance->cbeginValueOn(); voxel; ++voxel) {
        const openvdb::Vec3d p = field.grids().distance->indexToWorld(voxel.getCoord());
        const double error = 64 * std::abs(double(voxel.getValue()) - truth({p.x(), p.y(), p.z()}));
        bool border = false;
        for (int axis = 0; axis < 3; ++axis) {
            const int at = voxel.getCoord()[axis] & 7;
            border |= at == 0 || at == 7;
        }
        (border ? atBorder : elsewhere) += error;
        ++(border ? countBorder : countElsewhere);
    }
    CHECK(atBorder / double(countBorder) == Approx(elsewhere / double(countElsewhere)).epsilon(0.05));
}

TEST_CASE("a mesh smaller than a voxel, and one far from the origin, still have a band") {
    const LevelSet tiny = build(shapes::sphere(0.01f, 2), {.voxelSize = 1.f});
    CHECK(tiny.activeVoxels() > 27);
    const Mesh far = shapes::moved(shapes::sphere(0.5f, 4), {1e4f, -1e4f, 1e4f});
    const LevelSet field = build(far, {.voxelSize = 0.01f});
    const Errors e =
        errors(field, [](const glm::dvec3& p) { return glm::distance(p, glm::dvec3(1e4, -1e4, 1e4)) - 0.5; });
    CAPTURE(e.worst, e.mean);
    CHECK(e.worst < 0.8);  // coordinates of 1e4 have a precision of only 0.05 voxels
}

TEST_CASE("voxels too small for OpenVDB, and too large for fields, are refused with the scale to use") {
    // a part of 0.3 mm in metres, and one of a micrometre
    for (const auto& [size, scale] : {std::pair(3e-4f, "scale the mesh by 1000 (from metres to millimetres)"),
                                      std::pair(1e-6f, "scale the mesh by 1e+06,")}) {
        const Mesh part = shapes::box(glm::vec3(size));
        CHECK_THROWS_WITH(build(part, {.voxelSize = voxelSizeFor(part, 128)}),
                          Catch::Contains("2e-05") && Catch::Contains(scale));
    }
    const Mesh large = shapes::box(glm::vec3(1e30f));
    CHECK_THROWS_WITH(build(large, {.voxelSize = voxelSizeFor(large, 64)}),
                      Catch::Contains("above 1e+15") && Catch::Contains("scale the mesh by 1e-15"));
    const Mesh scaled = shapes::box(glm::vec3(3e-4f * 1000));
    CHECK(build(scaled, {.voxelSize = voxelSizeFor(scaled, 128)}).activeVoxels() > 0);
}

TEST_CASE("a band without a voxel is refused with its width") {
    const Mesh mesh = shapes::moved(shapes::box(glm::vec3(0.2f)), glm::vec3(0.5f));
    CHECK_THROWS_WITH(build(mesh, {.voxelSize = 1, .exteriorWidthVoxels = 0.01f, .interiorWidthVoxels = 0.02f}),
                      Catch::Contains("no voxel of 1 m lies within the band, 0.01 voxels outside and 0.02 inside"));
}

TEST_CASE("bad options and meshes are refused by name") {
    const Mesh mesh = shapes::sphere(1, 2);
    const auto refused = [&](BuildOptions options, const std::string& name) {
        CHECK_THROWS_AS(build(mesh, options), std::invalid_argument);
        CHECK_THROWS_WITH(build(mesh, options), Catch::Contains(name));
    };
    refused({}, "voxelSize");
    refused({.voxelSize = -1}, "voxelSize");
    refused({.voxelSize = NAN}, "voxelSize");
    refused({.voxelSize = INFINITY}, "voxelSize");
    refused({.voxelSize = 1e-9f}, "voxelSize");
    refused({.voxelSize = 1e-6f}, "voxelSize");
    refused({.voxelSize = 1, .exteriorWidthVoxels = 0}, "exteriorWidth");
    refused({.voxelSize = 1, .interiorWidthVoxels = 1e6f}, "interiorWidth");
    refused({.voxelSize = 1, .threads = -1}, "threads");
    for (const float bad : {NAN, -1.f, 101.f, 1e30f, INFINITY})
        for (const Sign sign : {Sign::automatic, Sign::flood})
            refused({.voxelSize = 1, .sign = sign, .gapVoxels = bad}, "gapVoxels must be in 0..100");
    for (const float bad : {NAN, -1.f, 0.f, 1001.f, INFINITY}) {
        refused({.voxelSize = 1, .exteriorWidthVoxels = bad}, "exteriorWidthVoxels");
        refused({.voxelSize = 1, .interiorWidthVoxels = bad}, "interiorWidthVoxels");
        refused({.voxelSize = bad > 0 ? INFINITY : bad}, "voxelSize");
    }
    // widths that overflow or underflow in the mesh's unit
    refused({.voxelSize = 1e37f, .exteriorWidthVoxels = 100}, "voxelSize");
    refused({.voxelSize = 1, .exteriorWidthVoxels = 1e-39f}, "exteriorWidth");
    refused({.voxelSize = 1e-3f, .interiorWidthVoxels = 1e-37f}, "interiorWidth");
    refused({.voxelSize = 1, .threads = 4097}, "threads");
    BuildOptions options{.voxelSize = 0.1f};
    for (const float delta : {0.f, 0.099f, 4.1f}) {
        options.doubleLayer.delta = delta;
        refused(options, "delta");
    }
    options = {.voxelSize = 0.1f};
    options.doubleLayer.delta = NAN;
    refused(options, "delta");
    for (const float bad : {NAN, 0.f, 0.9e-4f, 1.1e4f, INFINITY}) {
        options = {.voxelSize = 0.1f};
        options.doubleLayer.epsilon = bad;
        refused(options, "epsilon");
    }
    for (const float limit : {1e-4f, 1e4f}) {
        options = {.voxelSize = 0.1f, .method = Method::doubleLayer};
        options.doubleLayer.epsilon = limit;
        CHECK(build(shapes::sphere(0.1f, 2), options).activeVoxels() > 100);
    }
    options = {.voxelSize = 0.1f};
    options.doubleLayer.neighbourhood = 0;
    refused(options, "neighbourhood");
    options = {.voxelSize = 0.1f};
    options.doubleLayer.maxSubdivision = 0;
    refused(options, "maxSubdivision");
    CHECK_THROWS_WITH(build(Mesh{}, {.voxelSize = 1}), Catch::Contains("no triangle"));
    const Mesh flat{{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}}, {{0, 1, 2}}};
    for (const Method method : {Method::exact, Method::doubleLayer, Method::pseudonormal})
        CHECK_THROWS_WITH(build(flat, {.voxelSize = 1, .method = method}), Catch::Contains("no triangle with an area"));
    // 3e8 voxels of surface, 2000 voxels across the band at each
    refused(
        {.voxelSize = 2e-4f, .exteriorWidthVoxels = 1000, .interiorWidthVoxels = 1000, .method = Method::pseudonormal},
        "memory");
    CHECK_THROWS_AS(voxelSizeFor(mesh, 0), std::invalid_argument);
    CHECK_THROWS_AS(voxelSizeFor(mesh, -5), std::invalid_argument);
}

TEST_CASE("progress rises to one, and a false answer cancels") {
    const Mesh mesh = shapes::torusKnot(2, 3, 1, 0.2f);
    BuildOptions options{.voxelSize = voxelSizeFor(mesh, 200)};
    float last = 0;
    options.progress = [&](float part) {
        CHECK(part >= last);
        last = part;
        return true;
    };
    build(mesh, options);
    CHECK(last == 1.f);
    options.progress = [](float part) { return part < 0.3f; };
    CHECK_THROWS_AS(build(mesh, options), Cancelled);
}

TEST_CASE("a build can be cancelled at any moment, whatever the method") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    const Mesh mesh = shapes::torusKnot(2, 3, 1, 0.2f);
    for (const Method method : {Method::exact, Method::doubleLayer, Method::pseudonormal}) {
        BuildOptions options{.voxelSize = voxelSizeFor(mesh, 200), .method = method};
        int calls = 0;
        options.progress = [&](float) { return ++calls > 0; };
        build(mesh, options);
        for (int i = 0; i < 5; ++i) {
            // the callback is called by time, so a quick run may end before that
            int left = 1 + int(random() % unsigned(calls));
            bool asked = false;
            options.progress = [&](float) {
                asked = --left <= 0;
                return !asked;
            };
            CAPTURE(int(method), calls, left);
            bool cancelled = false;
            try {
                build(mesh, options);
            } catch (const Cancelled&) {
                cancelled = true;
            }
            CHECK(cancelled == asked);
        }
    }
}

TEST_CASE("what a filler throws ends the build") {
    const auto fill = [](const FillJob&) -> DeviceTimes { throw std::runtime_error("the device is on fire"); };
    const auto broken = makeOf<BlockFiller>(DeviceFiller{"broken", "", fill});
    CHECK_THROWS_WITH(build(shapes::sphere(1, 2), {.voxelSize = 0.1f, .method = Method::doubleLayer}, broken),
                      "the device is on fire");
}

TEST_CASE("times add up") {
    const LevelSet field = build(shapes::sphere(1, 5), {.voxelSize = 0.02f});
    const BuildTimes& times = field.buildTimes();
    CHECK(times.prepare > 0);
    CHECK(times.fill > 0);
    CHECK(times.assemble > 0);
    CHECK(times.total >= times.prepare + times.fill + times.assemble - 1e-6);
}
}  // namespace bilayer::build_test
