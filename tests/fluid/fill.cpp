#include "integration/fluid/fill.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "demos/shared/shapes.h"
#include "sdf/build.h"
#include "sdf/grids.h"

using namespace bilayer;

TEST_CASE("fill keeps the band and knows every other voxel of the box") {
    const float h = 0.04f;
    const LevelSet band = build(shapes::sphere(0.5f, 5), {.voxelSize = h, .exteriorWidth = 4, .interiorWidth = 2});
    const LevelSet filled = fluid::fill(band);
    const openvdb::FloatGrid &before = *band.grids().distance, &after = *filled.grids().distance;

    const openvdb::CoordBBox box = before.evalActiveVoxelBoundingBox();
    CHECK(after.evalActiveVoxelBoundingBox() == box);
    CHECK(filled.activeVoxels() == box.volume());
    double largest = 0;
    for (const openvdb::Coord& at : box) {
        const float value = after.tree().getValue(at);
        float old;
        if (before.tree().probeValue(at, old)) REQUIRE(value == old);
        largest = std::max(largest, std::abs(value - (at.asVec3d().length() * h - 0.5)));
    }
    CHECK(largest / h < 1.5);  // first order, 11 voxels from the band at most
    CHECK(after.tree().getValue(openvdb::Coord(0)) < -0.4f);
    CHECK(filled.exteriorWidth() == band.exteriorWidth());
    CHECK(filled.interiorWidth() == band.interiorWidth());
    CHECK(filled.method() == band.method());
    CHECK(filled.meshHash() == band.meshHash());
    CHECK(after.background() == before.background());
    // the sweep is off by more than the band was
    CHECK(largest > 2 * double(band.errorBound()));
    CHECK(std::isnan(filled.errorBound()));
}

TEST_CASE("fill refuses what cannot be swept") {
    // a sheet that the flood finds no inside of
    const Mesh sheet{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}};
    const LevelSet outside = build(sheet, {.voxelSize = 0.1f, .sign = Sign::flood});
    CHECK_THROWS_WITH(fluid::fill(outside), Catch::Matchers::Contains("no inside"));
    Mesh far = shapes::box({1, 1, 1});
    for (glm::vec3& p : far.points) p += glm::vec3(4000);
    const LevelSet apart = build(shapes::join({shapes::box({1, 1, 1}), far}), {.voxelSize = 0.1f});
    CHECK_THROWS_WITH(fluid::fill(apart), Catch::Matchers::Contains("GiB"));
}
