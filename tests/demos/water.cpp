// SPDX-License-Identifier: Apache-2.0
// The small liquid solver, in cases with an analytic result.
#include "demos/shared/water.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <random>

#include <bilayer/collider/mass.h>
#include <bilayer/integration/fluid/seed.h>
#include "demos/shared/shapes.h"
#include "demos/shared/surface_of.h"
#include "sdf/base/openvdb.h"
#include "tests/support/support.h"

namespace bilayer::water_test {
using openvdb::Coord;
using openvdb::FloatGrid;

namespace {

constexpr int side = 24;             // cells along the box
constexpr float voxel = 1.f / side;  // [m]

openvdb::math::Transform::Ptr cells() {
    return openvdb::math::Transform::createLinearTransform(double(voxel));
}

// Liquid below a height [m].
FloatGrid::Ptr pool(float height) {
    const FloatGrid::Ptr liquid = openvdb::createLevelSet<FloatGrid>(double(voxel));
    Mesh box = shapes::box({1, 1, 1});
    for (glm::vec3& p : box.points) p += glm::vec3(0.5f, 0.5f, height - 1);
    fluid::seed(*liquid, box);
    return liquid;
}

fluid::Solid sphereAt(const glm::vec3& centre, const fluid::Velocity& velocity = {}) {
    return fluid::solid(shapes::sphere(0.2f, 4), Pose{centre}, *cells(), {.velocity = velocity, .halfWidthVoxels = 6});
}

}  // namespace

TEST_CASE("a pool stays at rest, around a body too, wherever its surface is between the cells") {
    const float height = GENERATE(0.4f, 0.43f);
    const bool around = GENERATE(false, true);
    demo::Basin basin(*cells(), Coord(side));
    if (around) basin.place(sphereAt({0.5f, 0.5f, 0.35f}));
    demo::Water water(*pool(height), basin, {.restoring = 0});
    for (int step = 0; step < 10; ++step) {
        const demo::Projection projection = water.step(basin, 0.02f);
        CHECK(projection.converged);
        CHECK(projection.divergence < 1e-3);
    }
    CAPTURE(height, around);
    // 0.2 s of free fall would give 2 m/s
    CHECK(water.fastest() < (around ? 0.05f : 0.002f));
    CHECK(water.volume() == Approx(water.targetVolume()).epsilon(around ? 2e-3 : 2e-4));
}

TEST_CASE("a ball that spins next to a wall leaves a pool at rest") {
    demo::Basin basin(*cells(), Coord(side));
    basin.place(sphereAt({0.3f, 0.5f, 0.3f}, {{}, {0, 0, 6}}));  // its distances reach into the wall
    demo::Water water(*pool(0.4f), basin, {.restoring = 0});
    for (int step = 0; step < 5; ++step) water.step(basin, 0.02f);
    CHECK(water.fastest() < 0.4f);  // the ball has 1.2 m/s, and faces that it almost closes follow it
    CHECK(water.volume() == Approx(water.targetVolume()).epsilon(2e-3));
}

TEST_CASE("a drop falls as gravity says and keeps its volume") {
    demo::Basin basin(*cells(), Coord(side));
    const FloatGrid::Ptr drop = openvdb::createLevelSet<FloatGrid>(double(voxel));
    fluid::seed(*drop, shapes::sphere(0.15f, 5), Pose{{0.5f, 0.5f, 0.7f}});
    demo::Water water(*drop, basin, {.restoring = 0});
    for (int step = 0; step < 20; ++step) water.step(basin, 0.01f);
    const MassProperties mass = massProperties(demo::surfaceOf(water.shape()));
    // after n steps that update the velocity first, then the position: g dt^2 n (n - 1) / 2
    CHECK(mass.centre.z == Approx(0.7f - 9.81f * 1e-4f * 190).margin(0.1 * double(voxel)));
    CHECK(mass.centre.x == Approx(0.5f).margin(0.02 * double(voxel)));
    CHECK(water.volume() == Approx(water.targetVolume()).epsilon(0.01));
}

TEST_CASE("a pressure takes all divergence out, and leaves what moves with a body alone") {
    const std::uint32_t seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> speed(-1, 1);
    const fluid::Velocity moving{{0.3f, -0.2f, 0.1f}, {0, 0, 2}};
    demo::Basin basin(*cells(), Coord(side));
    basin.place(sphereAt({0.5f, 0.5f, 0.3f}, moving));
    demo::FaceVelocity velocity(*cells());
    for (const auto& axis : velocity.axes) {
        auto values = axis->getAccessor();
        for (int x = 0; x <= side; ++x)
            for (int y = 0; y <= side; ++y)
                for (int z = 0; z <= side; ++z) values.setValue(Coord(x, y, z), speed(random));
    }
    const FloatGrid::Ptr liquid = pool(0.52f);
    basin.extendBehindWalls(*liquid);
    const double growth = GENERATE(0.0, 0.2);
    demo::Pressure pressure;
    const demo::Projection projection = pressure.project(velocity, *liquid, basin, growth);
    CHECK(projection.converged);
    CHECK(projection.divergence < 5e-3);  // of differences up to 6 / voxel = 144 1/s
    // the total: the flux through the faces between liquid and air equals the growth plus the volume that the body
    // displaces
    CHECK(projection.cells > side * side * 8);
}

TEST_CASE("liquid without a surface keeps its volume, whatever growth is asked for") {
    const std::uint32_t seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> speed(-1, 1);
    const demo::Basin basin(*cells(), Coord(side));
    demo::FaceVelocity velocity(*cells());
    for (int axis = 0; axis < 3; ++axis) {
        auto values = velocity.axes[std::size_t(axis)]->getAccessor();
        for (auto face = basin.box().begin(); face; ++face) values.setValue(*face, speed(random));
    }
    const FloatGrid::Ptr liquid = pool(1.5f);  // over the brim
    basin.extendBehindWalls(*liquid);
    demo::Pressure pressure;
    const demo::Projection projection = pressure.project(velocity, *liquid, basin, 0.2);
    CHECK(projection.cells == side * side * side);
    CHECK(projection.converged);
    CHECK(projection.iterations < 200);
    CHECK(projection.divergence < 5e-3);
}

TEST_CASE("lost volume comes back in the time asked for") {
    const demo::Basin basin(*cells(), Coord(side));
    const double first = demo::Water(*pool(0.4f), basin).volume(), whole = 1.05 * first;
    demo::Water water(*pool(0.4f), basin, {.restoring = 0.1f, .volume = whole});
    for (int step = 0; step < 25; ++step) water.step(basin, 0.02f);
    CHECK(water.volume() == Approx(whole).epsilon(5e-3));
    CHECK(water.restored() == Approx(whole - first).epsilon(0.1));
}
}  // namespace bilayer::water_test
