// SPDX-License-Identifier: Apache-2.0
// Seeding: the result passes OpenVDB's own check and has the correct distances; invalid input changes nothing.
#include <openvdb/tools/Diagnostics.h>
#include <openvdb/tools/LevelSetSphere.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include <bilayer/integration/fluid/obstacle.h>
#include <bilayer/integration/fluid/seed.h>
#include <bilayer/sdf/build.h>
#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/mesh_io.h>
#include "demos/shared/shapes.h"
#include "sdf/base/openvdb.h"
#include "tests/fluid/liquids.h"
#include "tests/support/support.h"
#include "tests/support/truth.h"

namespace bilayer::seed_test {
using namespace bilayer::test;
using openvdb::FloatGrid;

namespace {

// Mean deviation of |gradient| from 1, by central differences within a voxel of the surface.
double meanSlopeError(const FloatGrid& liquid) {
    const auto values = liquid.getConstAccessor();
    const double voxel = liquid.voxelSize()[0];
    double sum = 0;
    int count = 0;
    for (auto v = liquid.cbeginValueOn(); v; ++v) {
        if (!(std::abs(*v) < voxel)) continue;
        openvdb::Vec3d gradient;
        for (int axis = 0; axis < 3; ++axis) {
            openvdb::Coord step(0);
            step[axis] = 1;
            gradient[axis] =
                double(values.getValue(v.getCoord() + step)) - double(values.getValue(v.getCoord() - step));
        }
        sum += std::abs(gradient.length() / (2 * voxel) - 1);
        ++count;
    }
    return sum / count;
}

const double ball = 4.0 / 3.0 * 3.141592653589793 * 0.125;  // of radius 0.5

}  // namespace

TEST_CASE("a sphere's field of any resolution seeds the sphere under the pose") {
    const Mesh sphere = shapes::sphere(0.5f, 5);
    const float fieldVoxel = GENERATE(0.0125f, 0.03f, 0.06f);
    const float liquidVoxel = GENERATE(0.02f, 0.03f, 0.05f);
    const float width = GENERATE(1.5f, 3.0f);
    CAPTURE(fieldVoxel, liquidVoxel, width);
    const auto liquid = emptyLiquid(liquidVoxel);
    const Pose pose = poseOf(0.8f);
    fluid::seed(*liquid, fieldOf(sphere, fieldVoxel, width), pose);
    requireLevelSet(*liquid);
    // the field's own error of some tenths of its voxel, and that of first-order sweeping beyond its band
    const double allowed = 0.35 + 0.35 * fieldVoxel / liquidVoxel;
    CHECK(error(*liquid, [&](const glm::dvec3& p) { return glm::length(p - glm::dvec3(pose.position)) - 0.5; }) <
          allowed);
    CHECK(volume(*liquid) == Approx(ball).epsilon(0.06));
    CHECK(liquid->background() == Approx(3 * liquidVoxel));
    CHECK(liquid->voxelSize()[0] == Approx(liquidVoxel));
}

TEST_CASE("a mesh seeds its exact distances, stretched and turned as it may be") {
    const Mesh mesh = shapes::torus(0.5f, 0.2f, 60, 30);
    const fluid::Placement placement(poseOf(0.8f), {1.3f, 0.6f, 0.9f});
    const auto liquid = emptyLiquid(0.03f, 4);
    liquid->transform().postTranslate({0.007, 0.011, 0.013});  // off the origin by fractions of a voxel
    fluid::seed(*liquid, mesh, placement);
    requireLevelSet(*liquid);
    Mesh placed = mesh;
    for (glm::vec3& p : placed.points) p = glm::vec3(placement.toWorld(p));
    const test::Truth truth(placed);
    CHECK(error(*liquid, [&](const glm::dvec3& p) { return truth.signedDistance(p); }) < 1e-3);

    // a stretched field lacks details below its voxel size
    const auto ofField = emptyLiquid(0.03f, 4);
    fluid::seed(*ofField, fieldOf(mesh, 0.02f, 1.5f), placement);
    requireLevelSet(*ofField);
    CHECK(error(*ofField, [&](const glm::dvec3& p) { return truth.signedDistance(p); }) < 0.15);
    CHECK(meanSlopeError(*ofField) < 1e-2);
}

TEST_CASE("far from the origin a liquid is as fine as near it") {
    const Mesh mesh = shapes::sphere(0.5f, 4);
    const auto near = emptyLiquid(0.03125f), far = emptyLiquid(0.03125f);
    fluid::seed(*near, mesh);
    const double shift = 1024;  // a whole number of voxels
    far->transform().postTranslate({-shift, 0, 0});
    fluid::seed(*far, mesh, Pose{{float(-shift), 0, 0}});
    REQUIRE(near->activeVoxelCount() == far->activeVoxelCount());
    // and with large coordinates of the liquid itself
    const auto away = emptyLiquid(0.03125f);
    fluid::seed(*away, mesh, Pose{{float(shift), 0, 0}});
    REQUIRE(near->activeVoxelCount() == away->activeVoxelCount());
    int differ = 0;
    for (auto voxel = near->cbeginValueOn(); voxel; ++voxel) {
        const openvdb::Coord& at = voxel.getCoord();
        differ += far->tree().getValue(at) != *voxel;
        differ += away->tree().getValue(at.offsetBy(32768, 0, 0)) != *voxel;
    }
    CHECK(differ == 0);
}

TEST_CASE("the band is complete: every voxel nearer than the half width is active") {
    const float halfWidth = GENERATE(3.0f, 5.0f);
    const auto liquid = emptyLiquid(0.04f, halfWidth);
    fluid::seed(*liquid, fieldOf(shapes::sphere(0.5f, 5), 0.02f, 2));
    requireLevelSet(*liquid);
    int missing = 0;
    for (const openvdb::Coord& at : openvdb::CoordBBox(openvdb::Coord(-25), openvdb::Coord(25))) {
        const double distance = at.asVec3d().length() * 0.04 - 0.5;
        const bool inside = std::abs(distance) < (halfWidth - 0.75) * 0.04;
        missing += inside && !liquid->tree().isValueOn(at);
        if (distance < -0.04) missing += !(liquid->tree().getValue(at) < 0);
    }
    CHECK(missing == 0);
}

TEST_CASE("overlapping and touching bodies stay a level set") {
    const Mesh mesh = GENERATE(shapes::sphere(0.5f, 4), shapes::box({0.4f, 0.3f, 0.2f}, 4), shapes::bowl(0.5f, 0.06f),
                               shapes::torus(0.5f, 0.12f));
    const LevelSet field = fieldOf(mesh, 0.025f);
    const float liquidVoxel = GENERATE(0.02f, 0.05f);
    const auto liquid = emptyLiquid(liquidVoxel);
    for (int i = 0; i < 4; ++i) {
        fluid::seed(*liquid, field, poseOf(0.9f * float(i), {0.21f * float(i), 0.13f * float(i), 0}));
        requireLevelSet(*liquid);
    }
    CHECK(volume(*liquid) > 0);
}

TEST_CASE("a mesh of the corpus seeds at any rotation") {
    const auto path = test::corpusMesh("bunny_watertight.obj");
    if (!path) return;
    const Mesh mesh = readMesh(*path);
    const float h = voxelSizeFor(mesh, 60);
    const LevelSet field = fieldOf(mesh, h);
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    std::normal_distribution<float> normal;
    const auto liquid = emptyLiquid(h);
    for (int i = 0; i < 3; ++i) {
        const glm::quat q(normal(random), normal(random), normal(random), normal(random));
        fluid::seed(*liquid, field, Pose{glm::vec3(normal(random), normal(random), normal(random)), glm::normalize(q)});
        requireLevelSet(*liquid);
    }
}

TEST_CASE("a cavity stays empty") {
    const Mesh inner = shapes::flipped(shapes::sphere(0.3f, 4));
    const LevelSet shell = fieldOf(shapes::join({shapes::sphere(0.5f, 4), inner}), 0.02f);
    const auto liquid = emptyLiquid(0.03f);
    fluid::seed(*liquid, shell, poseOf(1));
    requireLevelSet(*liquid);
    CHECK(volume(*liquid) == Approx(ball * (1 - 0.216)).epsilon(0.05));
}

TEST_CASE("a wide hole is rejected by name") {
    // a ball without the cap of 30 degrees around z
    Mesh mesh = shapes::sphere(0.5f, 5);
    std::erase_if(mesh.triangles, [&](const glm::uvec3& t) {
        return mesh.points[t.x].z + mesh.points[t.y].z + mesh.points[t.z].z > 3 * 0.433f;
    });
    for (const float voxel : {0.04f, 0.02f})
        for (const float angle : {0.f, 0.8f}) {
            CAPTURE(voxel, angle);
            const auto liquid = emptyLiquid(voxel);
            CHECK_THROWS_WITH(fluid::seed(*liquid, mesh, poseOf(angle)), Catch::Matchers::Contains("the mesh is open"));
            CHECK(liquid->empty());
        }
}

TEST_CASE("the voxels that the error about a hole recommends are accepted, and slightly smaller ones are refused") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> part(0, 1);
    const auto why = [](const Mesh& mesh, const Pose& pose, float voxel) -> std::string {
        try {
            fluid::seed(*emptyLiquid(voxel), mesh, pose);
        } catch (const std::invalid_argument& error) {
            return error.what();
        }
        return "";
    };
    const auto check = [&](const Mesh& mesh, float voxel) {
        const Pose pose = poseOf(6 * part(random), glm::vec3(part(random), part(random), part(random)));
        const std::string before = why(mesh, pose, voxel), recommends = "or take voxels of ";
        CAPTURE(voxel, before);
        REQUIRE_THAT(before, Catch::Contains(recommends));
        const float recommended = std::stof(before.substr(before.find(recommends) + recommends.size()));
        CHECK(recommended > voxel);
        CHECK(why(mesh, pose, recommended).find("open") == std::string::npos);
        CHECK_THAT(why(mesh, pose, 0.985f * recommended), Catch::Contains("the mesh is open"));
    };
    for (int i = 0; i < 6; ++i) {
        const float height = 0.5f - 0.12f * (0.2f + part(random)), size = 0.1f + 10 * part(random);
        Mesh mesh = shapes::sphere(0.5f, 4);
        std::erase_if(mesh.triangles, [&](const glm::uvec3& t) {
            return mesh.points[t.x].z + mesh.points[t.y].z + mesh.points[t.z].z > 3 * height;
        });
        for (glm::vec3& p : mesh.points) p *= size;
        check(mesh, size * (0.03f + 0.05f * part(random)));
    }
    if (const auto path = corpusMesh("bunny_5k_open.obj")) check(readMesh(*path), 0.00733f);
}

TEST_CASE("subtract and intersect") {
    const LevelSet field = fieldOf(shapes::sphere(0.5f, 5), 0.02f);
    const auto liquid = openvdb::tools::createLevelSetSphere<FloatGrid>(0.5f, openvdb::Vec3f(0.5f, 0, 0), 0.025f, 3);
    const double whole = volume(*liquid), lens = ball * 5 / 16;  // of unit spheres whose centres are one radius apart
    SECTION("subtract") {
        fluid::seed(*liquid, field, {}, fluid::SeedMode::subtract);
        requireLevelSet(*liquid);
        CHECK(volume(*liquid) == Approx(whole - lens).epsilon(0.05));
    }
    SECTION("intersect") {
        fluid::seed(*liquid, field, {}, fluid::SeedMode::intersect);
        requireLevelSet(*liquid);
        CHECK(volume(*liquid) == Approx(lens).epsilon(0.08));
    }
    SECTION("intersect with what is far away leaves nothing") {
        fluid::seed(*liquid, field, Pose{glm::vec3(9, 0, 0)}, fluid::SeedMode::intersect);
        CHECK(openvdb::tools::checkLevelSet(*liquid) == "");
        CHECK(liquid->activeVoxelCount() == 0);
    }
}

TEST_CASE("the background stays the caller's to the last bit, also where it is below three voxels by that") {
    for (const double voxel : {0.7, 0.1, 0.3, 0.0123, 0.02, 0.025, 0.05, double(0.7f), double(0.1f), double(0.02f)}) {
        CAPTURE(voxel);
        const auto liquid = openvdb::createLevelSet<FloatGrid>(voxel, 3);
        const float background = liquid->background();
        fluid::seed(*liquid, shapes::sphere(float(10 * voxel), 4));
        requireLevelSet(*liquid);
        CHECK(liquid->background() == background);
        fluid::seed(*liquid, fieldOf(shapes::sphere(float(10 * voxel), 4), float(voxel)), {},
                    fluid::SeedMode::subtract);
        CHECK(liquid->background() == background);
    }
}

TEST_CASE("whether an open mesh is accepted depends on the mesh and the voxel size, not on their position") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> place(-1, 1);
    for (const char* name : {"mesh2sdf_plane.obj", "mp_bathtub.obj", "bunny_5k_open.obj"}) {
        const auto path = test::corpusMesh(name);
        if (!path) continue;
        const Mesh mesh = readMesh(*path);
        bool finer = true;
        for (const float resolution : {200.f, 128.f, 100.f, 64.f, 48.f, 32.f, 20.f}) {
            const float voxel = voxelSizeFor(mesh, resolution);
            int seeded = 0, solid = 0, tried = 0;
            for (; tried < 3; ++tried) {
                const Pose pose{glm::vec3(place(random), place(random), place(random)) * voxel};
                const auto liquid = emptyLiquid(voxel);
                const auto why = [&](auto&& work) -> std::string {
                    try {
                        work();
                    } catch (const std::invalid_argument& error) {
                        return error.what();
                    }
                    return "";
                };
                const std::string bySeed = why([&] { fluid::seed(*liquid, mesh, pose); });
                const std::string bySolid = why([&] { fluid::solid(mesh, pose, liquid->transform()); });
                seeded += bySeed.empty();
                solid += bySolid.empty();
                CAPTURE(name, resolution, bySeed, bySolid);
                for (const std::string& text : {bySeed, bySolid})
                    CHECK((text.empty() || text.find("the mesh is open: its widest hole") != text.npos ||
                           text.find("the mesh has no inside") != text.npos));
            }
            CAPTURE(name, resolution, seeded, solid);
            CHECK(seeded == solid);
            CHECK((seeded == 0 || seeded == tried));
            // a mesh accepted at one voxel size is accepted at all larger ones
            CHECK((seeded > 0 || finer));
            finer = seeded == 0;
        }
    }
}

TEST_CASE("a body hardly wider than a voxel is seeded or rejected") {
    const Mesh mesh = shapes::sphere(0.5f, 3);
    int kept = 0, refused = 0;
    for (const float voxel : {0.2f, 0.4f, 0.6f, 0.8f, 1.f, 1.3f, 1.7f, 2.5f, 4.f, 50.f})
        for (const float aside : {0.f, 0.3f, 0.5f}) {
            CAPTURE(voxel, aside);
            const auto liquid = emptyLiquid(voxel);
            try {
                fluid::seed(*liquid, mesh, Pose{glm::vec3(aside * voxel)});
            } catch (const std::invalid_argument&) {
                CHECK(liquid->empty());
                ++refused;
                continue;
            }
            ++kept;
            requireLevelSet(*liquid);
            int inside = 0;
            for (auto value = liquid->cbeginValueAll(); value; ++value) inside += *value < 0;
            CHECK(inside > 0);
        }
    CHECK(kept > 5);
    CHECK(refused > 5);
}

TEST_CASE("bad input throws and changes nothing") {
    const LevelSet field = fieldOf(shapes::sphere(0.5f, 3), 0.05f);
    const float nan = std::numeric_limits<float>::quiet_NaN();
    const auto refused = [&](const FloatGrid::Ptr& liquid, const fluid::Placement& placement = {}) {
        const auto tree = liquid->treePtr();
        const auto before = liquid->deepCopy();
        CHECK_THROWS_AS(fluid::seed(*liquid, field, placement), std::invalid_argument);
        CHECK(liquid->treePtr() == tree);
        CHECK(liquid->activeVoxelCount() == before->activeVoxelCount());
        for (auto voxel = before->cbeginValueOn(); voxel; ++voxel)
            if (const float now = liquid->tree().getValue(voxel.getCoord()); now == now) REQUIRE(now == *voxel);
    };
    const auto sphere = [] {
        return openvdb::tools::createLevelSetSphere<FloatGrid>(0.5f, openvdb::Vec3f(0), 0.05f, 3);
    };
    auto fog = sphere();
    fog->setGridClass(openvdb::GRID_FOG_VOLUME);
    refused(fog);
    auto stretched = sphere();
    stretched->transform().preScale(openvdb::Vec3d(1, 2, 1));
    refused(stretched);
    refused(openvdb::tools::createLevelSetSphere<FloatGrid>(0.5f, openvdb::Vec3f(0), 0.05f, 2));
    auto poisoned = sphere();
    poisoned->tree().setValueOn(openvdb::Coord(10, 0, 0), nan);
    refused(poisoned);
    refused(sphere(), Pose{glm::vec3(nan, 0, 0)});
    refused(sphere(), Pose{glm::vec3(std::numeric_limits<float>::infinity(), 0, 0)});
    refused(sphere(), Pose{glm::vec3(1e30f, 0, 0)});
    refused(sphere(), Pose{glm::vec3(0), glm::quat(2, 0, 0, 0)});
    refused(sphere(), Pose{glm::vec3(0), glm::quat(0, 0, 0, 0)});
    refused(sphere(), Pose{glm::vec3(0), glm::quat(1, nan, 0, 0)});
    refused(sphere(), {{}, {1, 0, 1}});
    refused(sphere(), {{}, {1, -1, 1}});
    refused(sphere(), {{}, {1, 1, nan}});
    refused(emptyLiquid(1e-4f), {{}, glm::vec3(100)});
    auto mirrored = sphere();
    mirrored->transform().preScale(openvdb::Vec3d(-1, 1, 1));
    refused(mirrored);
    CHECK_THROWS_WITH(fluid::seed(*mirrored, shapes::sphere(0.5f, 3)), Catch::Matchers::Contains("mirror"));
    // a surface without an inside cannot be seeded: as a mesh, as a field, or as a field in the liquid's own voxels
    const Mesh sheet{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}};
    const LevelSet empty = build(sheet, {.voxelSize = 0.1f, .sign = Sign::flood});
    const auto liquid = sphere();
    CHECK_THROWS_WITH(fluid::seed(*liquid, empty, poseOf(1)), Catch::Matchers::Contains("no surface"));
    const auto own = emptyLiquid(0.1f);
    CHECK_THROWS_WITH(fluid::seed(*own, empty), Catch::Matchers::Contains("no inside"));
    CHECK_THROWS_WITH(fluid::seed(*own, sheet), Catch::Matchers::Contains("no inside"));
    CHECK(own->empty());
    CHECK_THROWS_AS(fluid::seed(*liquid, Mesh{}), std::invalid_argument);
}
}  // namespace bilayer::seed_test
