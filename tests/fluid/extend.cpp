// SPDX-License-Identifier: Apache-2.0
#include <bilayer/integration/fluid/extend.h>

#include <catch2/catch.hpp>
#include <cmath>

#include <bilayer/sdf/build.h>
#include <bilayer/sdf/grids.h>
#include "demos/shared/shapes.h"
#include "sdf/base/openvdb.h"

namespace bilayer::extend_test {
TEST_CASE("fill keeps the band and knows every other voxel of the box") {
    const float h = 0.04f;
    const LevelSet band =
        build(shapes::sphere(0.5f, 5), {.voxelSize = h, .exteriorWidthVoxels = 4, .interiorWidthVoxels = 2});
    const LevelSet extended = fluid::extend(band);
    const openvdb::FloatGrid &before = *band.grids().distance, &after = *extended.grids().distance;

    const openvdb::CoordBBox box = before.evalActiveVoxelBoundingBox();
    CHECK(after.evalActiveVoxelBoundingBox() == box);
    CHECK(extended.activeVoxels() == box.volume());
    double largest = 0;
    for (const openvdb::Coord& at : box) {
        const float value = after.tree().getValue(at);
        float old;
        if (before.tree().probeValue(at, old)) REQUIRE(value == old);
        largest = std::max(largest, std::abs(value - (at.asVec3d().length() * h - 0.5)));
    }
    CHECK(largest / h < 1.5);  // first order, at most 11 voxels from the band
    CHECK(after.tree().getValue(openvdb::Coord(0)) < -0.4f);
    CHECK(extended.exteriorWidth() == band.exteriorWidth());
    CHECK(extended.interiorWidth() == band.interiorWidth());
    CHECK(extended.method() == band.method());
    CHECK(extended.meshHash() == band.meshHash());
    CHECK(after.background() == before.background());
    // the error of the sweep exceeds that of the band
    CHECK(largest > 2 * double(band.errorBound()));
    CHECK(std::isnan(extended.errorBound()));
}

TEST_CASE("fill goes as far as it is asked to") {
    const float h = 0.04f, distance = 0.3f;
    const LevelSet band =
        build(shapes::sphere(0.5f, 5), {.voxelSize = h, .exteriorWidthVoxels = 4, .interiorWidthVoxels = 2});
    const LevelSet extended = fluid::extend(band, distance);
    const openvdb::FloatGrid &before = *band.grids().distance, &after = *extended.grids().distance;
    CHECK(extended.exteriorWidth() == distance);
    CHECK(extended.interiorWidth() == distance);
    double largest = 0;
    int missing = 0;
    for (const openvdb::Coord& at : openvdb::CoordBBox::createCube(openvdb::Coord(-24), 49)) {
        const double truth = at.asVec3d().length() * h - 0.5;
        float value, old;
        const bool active = after.tree().probeValue(at, value);
        if (before.tree().probeValue(at, old)) REQUIRE(value == old);
        missing += !active && std::abs(truth) < distance - 1.5 * h;
        if (active)
            largest = std::max(largest, std::abs(value - truth));
        else
            CHECK(value == std::copysign(distance, float(truth)));
    }
    CHECK(missing == 0);
    CHECK(largest / h < 1);
    CHECK(std::isnan(extended.errorBound()));
    // a wider existing band is kept
    CHECK(fluid::extend(band, h).exteriorWidth() == band.exteriorWidth());
    CHECK(fluid::extend(band, 3 * h).interiorWidth() == 3 * h);
}

TEST_CASE("extend() rejects fields without an inside and boxes that are too large") {
    // an open surface in which the flood finds no inside
    const Mesh sheet{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}};
    const LevelSet outside = build(sheet, {.voxelSize = 0.1f, .sign = Sign::flood});
    CHECK_THROWS_WITH(fluid::extend(outside), Catch::Matchers::Contains("no inside"));
    Mesh far = shapes::box({1, 1, 1});
    for (glm::vec3& p : far.points) p += glm::vec3(4000);
    const LevelSet apart = build(shapes::join({shapes::box({1, 1, 1}), far}), {.voxelSize = 0.1f});
    CHECK_THROWS_WITH(fluid::extend(apart), Catch::Matchers::Contains("GiB"));
    CHECK_THROWS_AS(fluid::extend(apart, 0), std::invalid_argument);
    CHECK_THROWS_AS(fluid::extend(apart, std::numeric_limits<float>::quiet_NaN()), std::invalid_argument);
    CHECK_THROWS_WITH(fluid::extend(apart, 1e30f), Catch::Matchers::Contains("too far"));
}
}  // namespace bilayer::extend_test
