// SPDX-License-Identifier: Apache-2.0
#include <bilayer/sdf/nanovdb.h>

#include <nanovdb/util/GridHandle.h>
#include <nanovdb/util/IO.h>
#include <nanovdb/util/SampleFromVoxels.h>
#include <oneapi/tbb/global_control.h>
#include <openvdb/tools/Interpolation.h>

#include <algorithm>
#include <atomic>
#include <catch2/catch.hpp>
#include <cmath>
#include <fstream>
#include <random>
#include <string>
#include <thread>

#include <bilayer/sdf/build.h>
#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/vdb_io.h>
#include "demos/shared/shapes.h"
#include "sdf/base/openvdb.h"
#include "tests/support/support.h"

namespace bilayer::nanovdb_test {
namespace {

LevelSet torus(float voxelSize = 0.05f) {
    return build(shapes::torus(1, 0.3f, 60, 30),
                 {.voxelSize = voxelSize, .exteriorWidthVoxels = 3, .interiorWidthVoxels = 2, .triangles = true});
}

template <class Nano>
const Nano& gridIn(const NanoGrid& grid) {
    REQUIRE(reinterpret_cast<std::uintptr_t>(grid.bytes().data()) % 32 == 0);
    const auto& nano = *reinterpret_cast<const Nano*>(grid.bytes().data());
    REQUIRE(nano.isValid());
    REQUIRE(nano.gridSize() == grid.bytes().size());
    return nano;
}

// Compares every value and state in and around the box of the active voxels, the background and the name.
template <class Nano, class Open>
void requireSame(const Nano& nano, const Open& open) {
    CHECK(nano.activeVoxelCount() == open.activeVoxelCount());
    CHECK(nano.tree().background() == open.background());
    CHECK(std::string(nano.gridName()) == open.getName());
    auto box = open.evalActiveVoxelBoundingBox();
    box.expand(20);
    const auto ours = nano.getAccessor();
    const auto theirs = open.getConstAccessor();
    std::size_t wrong = 0;
    for (auto at = box.begin(); at; ++at) {
        const nanovdb::Coord ijk((*at).x(), (*at).y(), (*at).z());
        wrong += ours.getValue(ijk) != theirs.getValue(*at) || ours.isActive(ijk) != theirs.isValueOn(*at);
    }
    CHECK(wrong == 0);
}

bool sameBytes(const NanoGrid& a, const NanoGrid& b) {
    return std::equal(a.bytes().begin(), a.bytes().end(), b.bytes().begin(), b.bytes().end());
}

}  // namespace

TEST_CASE("a NanoVDB grid holds what the level set holds") {
    const LevelSet field = torus();
    const NanoGrid made = toNanoVdb(field);
    const auto& nano = gridIn<nanovdb::FloatGrid>(made);
    requireSame(nano, *field.grids().distance);
    CHECK(nano.gridClass() == nanovdb::GridClass::LevelSet);
    CHECK(nano.voxelSize()[0] == field.grids().distance->voxelSize()[0]);
    CHECK(nano.tree().getValue(nanovdb::Coord(20, 0, 0)) == -field.interiorWidth());  // in the tube

    const std::optional<NanoGrid> triangles = trianglesToNanoVdb(field);
    REQUIRE(triangles);
    requireSame(gridIn<nanovdb::Int32Grid>(*triangles), *field.grids().triangle);
    const LevelSet without = build(shapes::torus(1, 0.3f, 60, 30), {.voxelSize = 0.05f});
    CHECK_FALSE(trianglesToNanoVdb(without));
}

TEST_CASE("NanoVDB places and samples the grid as OpenVDB does") {
    // also a grid whose origin is shifted by whole voxels
    auto grid = openvdb::ConstPtrCast<openvdb::FloatGrid>(torus().grids().distance)->deepCopy();
    grid->transform().postTranslate(40 * grid->voxelSize());
    const LevelSet field(std::make_shared<Grids>(Grids{grid, nullptr}));
    const NanoGrid made = toNanoVdb(field);
    const auto& nano = gridIn<nanovdb::FloatGrid>(made);
    const auto accessor = nano.getAccessor();
    const auto sampler = nanovdb::createSampler<1>(accessor);
    const openvdb::tools::GridSampler<openvdb::FloatGrid, openvdb::tools::BoxSampler> truth(*grid);
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> coordinate(0.5, 3.5);
    int inside = 0;
    for (int i = 0; i < 20000; ++i) {
        const openvdb::Vec3d world(coordinate(random), coordinate(random), coordinate(random) / 3 + 1.4);
        const auto index = nano.worldToIndex(nanovdb::Vec3d(world.x(), world.y(), world.z()));
        const openvdb::Vec3d expected = grid->worldToIndex(world);
        for (int axis = 0; axis < 3; ++axis) REQUIRE(index[axis] == Approx(expected[axis]).margin(1e-9));
        const float value = truth.isSample(expected);
        inside += value < 0;
        REQUIRE(sampler(index) == Approx(value).margin(1e-6));
    }
    CHECK(inside > 1000);
}

TEST_CASE("NanoVDB grids have the same bytes for any number of threads") {
    const LevelSet field = torus(0.02f);
    const auto with = [&](std::size_t threads) {
        const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
        return std::pair(toNanoVdb(field), *trianglesToNanoVdb(field));
    };
    const auto one = with(1), four = with(4);
    CHECK(sameBytes(one.first, four.first));
    CHECK(sameBytes(one.second, four.second));
}

TEST_CASE("a field may be read while NanoVDB grids are made of it") {
    const LevelSet field = torus(0.02f);
    const NanoGrid alone = toNanoVdb(field);
    const openvdb::FloatTree& tree = field.grids().distance->tree();
    std::atomic<bool> ready = false, done = false;
    std::size_t wrong = 0;
    std::thread reader([&] {
        do {
            ready = true;
            for (auto leaf = tree.cbeginLeaf(); leaf; ++leaf) wrong += tree.probeConstLeaf(leaf->origin()) != &*leaf;
        } while (!done);
    });
    while (!ready) std::this_thread::yield();
    for (int i = 0; i < 10; ++i) CHECK(sameBytes(toNanoVdb(field), alone));
    done = true;
    reader.join();
    CHECK(wrong == 0);
}

TEST_CASE("NanoVDB reads the file") {
    const LevelSet field = torus();
    const auto path = test::scratch("torus.nvdb");
    writeNanoVdb(path, field);
    const auto grids = nanovdb::io::readGrids(path.string());
    REQUIRE(grids.size() == 2);
    REQUIRE(grids[0].grid<float>());
    REQUIRE(grids[1].grid<std::int32_t>());
    requireSame(*grids[0].grid<float>(), *field.grids().distance);
    requireSame(*grids[1].grid<std::int32_t>(), *field.grids().triangle);
    CHECK(nanovdb::io::readGrid(path.string(), std::string("triangle")).gridMetaData()->gridType() ==
          nanovdb::GridType::Int32);
    const std::vector<nanovdb::io::GridMetaData> contents = nanovdb::io::readGridMetaData(path.string());
    CHECK(contents[0].gridClass == nanovdb::GridClass::LevelSet);
    CHECK(contents[0].voxelCount == field.activeVoxels());
}

TEST_CASE("a .nvdb file that cannot be written is named, and leaves what was there") {
    const LevelSet field = torus();
    CHECK_THROWS_WITH(writeNanoVdb("/nonexistent/a.nvdb", field), Catch::Contains("/nonexistent/a.nvdb"));
    CHECK_THROWS_WITH(writeNanoVdb("/dev/full", field), Catch::Contains("/dev/full"));
    CHECK_THROWS_AS(writeNanoVdb("/dev/full", field), std::runtime_error);
    // overwrites a file in place
    const auto path = test::scratch("kept.nvdb");
    std::ofstream(path) << "old";
    writeNanoVdb(path, field);
    CHECK(std::filesystem::file_size(path) > 100000);
}
}  // namespace bilayer::nanovdb_test
