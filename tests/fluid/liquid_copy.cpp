// SPDX-License-Identifier: Apache-2.0
// Liquids that start as stored level sets, with origins far from zero.
#include "integration/fluid/detail/liquid_copy.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include <bilayer/integration/fluid/seed.h>
#include <bilayer/sdf/build.h>
#include <bilayer/sdf/grids.h>
#include "demos/shared/shapes.h"
#include "sdf/base/openvdb.h"
#include "tests/fluid/liquids.h"

namespace bilayer::liquid_copy_test {
using namespace bilayer::test;
using openvdb::FloatGrid;

TEST_CASE("a liquid that starts as a level set keeps its distances and origin, and forgets the mesh") {
    Mesh mesh = shapes::sphere(0.5f, 3);
    mesh.origin = {1e6, 2e6, 3e6};
    const LevelSet start = build(mesh, {.voxelSize = 0.05f});
    const FloatGrid::Ptr liquid = fluid::detail::liquidCopy(start);
    const FloatGrid& distances = *start.grids().distance;
    CHECK(liquid->tree().hasSameTopology(distances.tree()));
    CHECK(liquid->transform() == distances.transform());
    CHECK((*distances.getMetadata<openvdb::Vec3DMetadata>(metadata::origin) == *(*liquid)[metadata::origin]));
    REQUIRE(distances[metadata::meshHash]);
    for (const char* name : {metadata::meshHash, metadata::method, metadata::sign, metadata::interiorWidth}) {
        CAPTURE(name);
        CHECK_FALSE((*liquid)[name]);
    }
}

TEST_CASE("a body and a liquid with origins meet where these put them") {
    const glm::dvec3 far(5e5, -4e6, 300);
    Mesh tank = shapes::box(glm::vec3(0.5f)), body = shapes::sphere(0.3f, 4);
    const auto united = [&] {
        const LevelSet start = build(tank, {.voxelSize = 0.03125f});
        const auto liquid = openvdb::gridPtrCast<FloatGrid>(inWorld(start.grids().distance, start));
        fluid::seed(*liquid, body, {}, fluid::SeedMode::unite);
        requireLevelSet(*liquid);
        return liquid;
    };
    body.origin = {0, 0, 0.625};
    const FloatGrid::Ptr near = united();
    tank.origin = far, body.origin += far;
    const FloatGrid::Ptr there = united();
    const openvdb::Vec3d zero = there->indexToWorld(openvdb::Coord(0));
    CHECK(glm::distance(glm::dvec3(zero.x(), zero.y(), zero.z()), far) < 1e-6);
    REQUIRE(there->activeVoxelCount() == near->activeVoxelCount());
    double difference = 0;
    for (auto voxel = near->cbeginValueOn(); voxel; ++voxel)
        difference = std::max(difference, double(std::abs(*voxel - there->tree().getValue(voxel.getCoord()))));
    CHECK(difference < 1e-6);
}
}  // namespace bilayer::liquid_copy_test
