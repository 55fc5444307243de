// SPDX-License-Identifier: Apache-2.0
#include <bilayer/integration/bullet/settings.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <stdexcept>

#include <bilayer/collider/field.h>
#include <bilayer/sdf/build.h>
#include "demos/shared/shapes.h"

namespace bilayer::settings_test {
using bullet::recommendSettings;
using bullet::SceneRequirements;
using bullet::Settings;

namespace {

// A plate of 1 x 1 m.
MeshReport plate(float thickness) {
    return inspect(shapes::box({0.5f, 0.5f, 0.5f * thickness}, 8));
}

MeshReport ball(float radius) {
    return inspect(shapes::sphere(radius, 4));
}

bool warnsOf(const Settings& settings, const std::string& what) {
    for (const std::string& warning : settings.warnings)
        if (warning.find(what) != std::string::npos) return true;
    return false;
}

}  // namespace

TEST_CASE("A plate gets three voxels of its thickness") {
    const Settings settings = recommendSettings(plate(0.03f), {.speed = 1});
    CHECK(settings.voxelSize == Approx(0.01));
    CHECK(settings.wallVoxels == Approx(3));
    CHECK(settings.margin == settings.voxelSize);
    // one voxel of margin and a cell's diagonal
    CHECK(settings.exteriorWidthVoxels == 3);
    CHECK(settings.splitImpulse == -settings.voxelSize);
    CHECK_FALSE(warnsOf(settings, "voxels thick"));
}

TEST_CASE("A plate too thin for any affordable field gets a warning") {
    const Settings settings = recommendSettings(plate(1e-3f), {.speed = 1});
    CHECK(settings.voxelSize == Approx(1.f / 512));
    CHECK(warnsOf(settings, "voxels thick"));
    // a user-defined voxel size is checked by the same rule
    CHECK(warnsOf(recommendSettings(plate(0.03f), {.voxelSize = 0.016f}), "voxels thick"));
    CHECK_FALSE(warnsOf(recommendSettings(plate(0.03f), {.voxelSize = 0.015f}), "voxels thick"));
}

TEST_CASE("A thin tip does not determine the voxel size, but gets a warning") {
    // a ball with a thin plate of 1e-5 of its area on top
    Mesh tip = shapes::box({5e-3f, 5e-3f, 1e-4f});
    for (glm::vec3& point : tip.points) point.z += 0.6f;
    const MeshReport mesh = inspect(shapes::join({shapes::sphere(0.5f, 4), tip}));
    CHECK(mesh.thinnestWall == Approx(2e-4).margin(2e-7));  // coordinates near 0.6 are rounded by 6e-8
    CHECK(mesh.commonWall > 0.9f);
    const Settings settings = recommendSettings(mesh, {});
    CHECK(settings.voxelSize == Approx(mesh.bounds.longestSide() / 64));
    CHECK(warnsOf(settings, "thinnest part"));
    CHECK_FALSE(warnsOf(settings, "voxels thick"));
}

TEST_CASE("A ball has no thin wall: its size decides") {
    const Settings settings = recommendSettings(ball(0.5f), {});
    CHECK(settings.voxelSize == Approx(1.f / 64));
    CHECK(settings.substeps == 1);
    CHECK(settings.substepsWithoutSpeculation == 1);
    // unless it collides with one, or must fit through a gap
    CHECK(recommendSettings(ball(0.5f), {.thickness = 0.03f}).voxelSize == Approx(0.01));
    // its own wall counts if it is thinner
    CHECK(recommendSettings(plate(0.03f), {.thickness = 0.5f}).voxelSize == Approx(0.01));
    CHECK(warnsOf(recommendSettings(ball(0.5f), {.margin = 0}), "margin"));
    CHECK(recommendSettings(ball(0.5f), {.gap = 0.01f}).voxelSize == Approx(0.005));
    CHECK(warnsOf(recommendSettings(ball(0.5f), {.gap = 0.01f, .voxelSize = 0.01f}), "gap"));
    CHECK_FALSE(warnsOf(recommendSettings(ball(0.5f), {.gap = 0.01f}), "gap"));
}

TEST_CASE("Fast bodies get substeps or continuous collision recommended") {
    // 10 m/s at 1/60 s is a displacement of 16.7 cm; half of the plate is 1.5 cm: 11.1 steps. Its spin may then be 20
    // rad/s, 0.33 rad per step.
    const Settings fast = recommendSettings(plate(0.03f), {.speed = 10});
    CHECK(fast.substepsWithoutSpeculation == 12);
    CHECK(fast.substeps == 1);
    CHECK(warnsOf(fast, "speculative contacts"));
    CHECK(warnsOf(fast, "WorldExtensions"));
    CHECK(fast.interiorWidthVoxels == 10);
    // below the margin nothing tunnels
    const Settings slow = recommendSettings(plate(0.03f), {.speed = 0.5f});
    CHECK(slow.substepsWithoutSpeculation == 1);
    CHECK_FALSE(warnsOf(slow, "speculative contacts"));
    CHECK(slow.interiorWidthVoxels == 3);
    // rotation curves the paths of points: at most half a radian per step
    CHECK(recommendSettings(plate(0.03f), {.speed = 1, .spin = 100}).substeps == 4);
    CHECK(recommendSettings(plate(0.03f), {.step = 1.f / 240, .speed = 1, .spin = 100}).substeps == 1);
    CHECK(recommendSettings(plate(0.03f), {.speed = 100, .spin = 0}).substeps == 1);
    CHECK(recommendSettings(plate(0.03f), {.speed = 100}).substeps == 7);
    const Settings absurd = recommendSettings(plate(0.03f), {.step = 1e30f, .speed = 1e30f});
    CHECK(absurd.substeps == 1000000);
    CHECK(warnsOf(absurd, "1000000 substeps or more"));
}

TEST_CASE("Settings outside the limits of Bullet and its solver get a warning") {
    CHECK(warnsOf(recommendSettings(ball(0.05f), {}), "setSleepingThresholds"));
    CHECK_FALSE(warnsOf(recommendSettings(ball(0.15f), {}), "setSleepingThresholds"));
    CHECK(warnsOf(recommendSettings(ball(5), {.massRatio = 11}), "masses"));
    CHECK_FALSE(warnsOf(recommendSettings(ball(5), {.massRatio = 10}), "masses"));
    CHECK(recommendSettings(ball(5), {}).warnings.empty());
    Mesh open = shapes::sphere(5, 3);
    open.triangles.pop_back();
    CHECK(warnsOf(recommendSettings(inspect(open), {}), "not closed"));
    Mesh inside = shapes::sphere(5, 3);
    for (glm::uvec3& triangle : inside.triangles) std::swap(triangle.x, triangle.y);
    CHECK(warnsOf(recommendSettings(inspect(inside), {}), "not clean"));
}

TEST_CASE("Estimates are near the built field") {
    const Mesh mesh = GENERATE(shapes::sphere(0.5f, 5), shapes::torus(0.4f, 0.1f), shapes::box({0.5f, 0.5f, 0.05f}, 8));
    const Settings settings = recommendSettings(inspect(mesh), {.speed = 1});
    const LevelSet field = build(mesh, {.voxelSize = settings.voxelSize,
                                        .exteriorWidthVoxels = float(settings.exteriorWidthVoxels),
                                        .interiorWidthVoxels = float(settings.interiorWidthVoxels)});
    CHECK(double(settings.voxels) == Approx(double(field.activeVoxels())).epsilon(0.2));
    const double bytes = double(Field(field).memoryBytes());
    CHECK(bytes < 1.3 * double(settings.fieldBytes));
    CHECK(bytes > 0.5 * double(settings.fieldBytes));
    CHECK(settings.buildSeconds > 0);
}

TEST_CASE("Invalid scenes are rejected by name") {
    const MeshReport mesh = ball(0.5f);
    const float nan = std::numeric_limits<float>::quiet_NaN();
    CHECK_THROWS_WITH(recommendSettings(mesh, {.step = 0}), Catch::Contains("step"));
    CHECK_THROWS_WITH(recommendSettings(mesh, {.speed = -1}), Catch::Contains("speed"));
    CHECK_THROWS_WITH(recommendSettings(mesh, {.spin = nan}), Catch::Contains("spin"));
    CHECK_THROWS_WITH(recommendSettings(mesh, {.thickness = nan}), Catch::Contains("thickness"));
    CHECK_THROWS_WITH(recommendSettings(mesh, {.gap = -1}), Catch::Contains("gap"));
    CHECK_THROWS_WITH(recommendSettings(mesh, {.massRatio = 0.5f}), Catch::Contains("mass ratio"));
    CHECK_THROWS_WITH(recommendSettings(mesh, {.margin = nan}), Catch::Contains("margin"));
    CHECK_THROWS_WITH(recommendSettings(mesh, {.voxelSize = 1e-9f}),
                      Catch::Contains("voxel size") && Catch::Contains("2e-05"));
    CHECK_THROWS_WITH(recommendSettings(ball(1e5f), {.voxelSize = 2e-5f}),
                      Catch::Contains("voxel size") && Catch::Contains("1e+09"));
    CHECK_THROWS_AS(recommendSettings(MeshReport{}, {}), std::invalid_argument);
}
}  // namespace bilayer::settings_test
