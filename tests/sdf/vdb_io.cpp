// SPDX-License-Identifier: Apache-2.0
#include <bilayer/sdf/vdb_io.h>

#include <openvdb/io/File.h>
#include <openvdb/openvdb.h>
#include <openvdb/tools/Dense.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <fstream>
#include <functional>
#include <iterator>
#include <type_traits>

#include <bilayer/sdf/build.h>
#include <bilayer/sdf/grids.h>
#include "demos/shared/shapes.h"
#include "sdf/base/openvdb.h"
#include "sdf/base/quoted_text.h"
#include "tests/support/random.h"
#include "tests/support/support.h"

namespace bilayer::vdb_io_test {
namespace {

LevelSet torus() {
    return build(shapes::torus(1, 0.3f, 60, 30),
                 {.voxelSize = 0.05f, .exteriorWidthVoxels = 3, .interiorWidthVoxels = 2, .triangles = true});
}

}  // namespace

TEST_CASE("a field survives its file") {
    const LevelSet field = torus();
    const auto path = test::scratch("torus.vdb");
    writeVdb(path, field);
    const LevelSet back = readVdb(path);
    CHECK(back.voxelSize() == field.voxelSize());
    CHECK(back.exteriorWidth() == field.exteriorWidth());
    CHECK(back.interiorWidth() == field.interiorWidth());
    CHECK(back.activeVoxels() == field.activeVoxels());
    CHECK(back.leaves() == field.leaves());
    CHECK(back.method() == "exact");
    CHECK(back.sign() == "normals");
    CHECK(back.signReason() == "closed and oriented");
    CHECK(back.signConflicts() == 0);
    CHECK(back.errorBound() == Approx(1e-4 * 0.05));
    CHECK(back.meshHash() == hash(shapes::torus(1, 0.3f, 60, 30)));
    REQUIRE(back.grids().triangle);
    const auto values = back.grids().distance->getConstAccessor();
    for (auto value = field.grids().distance->cbeginValueAll(); value; ++value)
        REQUIRE(values.getValue(value.getCoord()) == value.getValue());
}

TEST_CASE("A field keeps its voxels and its origin far from zero, or is not written") {
    const auto path = test::scratch("far.vdb");
    for (double distance = 1e3; distance <= 1e16; distance *= 10) {
        Mesh mesh = shapes::box({0.8f, 0.5f, 0.3f}, 1);
        mesh.origin = {distance, -distance / 3, 0.7 * distance};
        const LevelSet field = build(mesh, {.voxelSize = 0.04f});
        std::filesystem::remove(path);
        CAPTURE(distance);
        if (distance > 1e9) {
            CHECK_THROWS_WITH(writeVdb(path, field),
                              Catch::Contains("voxels from zero") && Catch::Contains("larger voxels"));
            CHECK_FALSE(std::filesystem::exists(path));
            continue;
        }
        writeVdb(path, field);
        const LevelSet back = readVdb(path);
        CHECK(back.voxelSize() == Approx(field.voxelSize()).epsilon(1e-5));
        CHECK(back.origin() == mesh.origin);
        CHECK(back.activeVoxels() == field.activeVoxels());
    }
}

TEST_CASE("half floats halve the file and keep three digits") {
    const LevelSet field = torus();
    writeVdb(test::scratch("full.vdb"), field);
    writeVdb(test::scratch("half.vdb"), field, {.halfFloat = true});
    CHECK(std::filesystem::file_size(test::scratch("half.vdb")) <
          std::filesystem::file_size(test::scratch("full.vdb")));
    const LevelSet back = readVdb(test::scratch("half.vdb"));
    CHECK(back.activeVoxels() == field.activeVoxels());
    const auto values = back.grids().distance->getConstAccessor();
    for (auto value = field.grids().distance->cbeginValueOn(); value; ++value)
        REQUIRE(values.getValue(value.getCoord()) ==
                Approx(value.getValue()).margin(double(back.errorBound() - field.errorBound())).epsilon(0));
    CHECK(back.errorBound() == storedErrorBound(field, {.halfFloat = true}));
    CHECK(back.errorBound() > field.errorBound());
    CHECK(back.errorBound() < 1.6e-3f * field.voxelSize());
}

TEST_CASE("a plain OpenVDB program reads the file") {
    writeVdb(test::scratch("plain.vdb"), torus());
    openvdb::io::File file(test::scratch("plain.vdb").string());
    file.open();
    CHECK(file.hasGrid("distance"));
    CHECK(file.hasGrid("triangle"));
    CHECK(file.readGrid("distance")->getGridClass() == openvdb::GRID_LEVEL_SET);
}

TEST_CASE("a field states how its signs were found") {
    const Mesh mesh = shapes::torus(1, 0.3f, 60, 30);
    BuildOptions options{.voxelSize = 0.05f};
    options.method = Method::doubleLayer;
    const LevelSet layers = build(mesh, options);
    CHECK(layers.method() == "double-layer");
    CHECK(layers.sign() == "layers");
    CHECK(layers.errorBound() >= 4.0f / 3 * 0.05f);  // theorem 1 of the paper
    options.method = Method::pseudonormal;
    options.sign = Sign::winding;
    const LevelSet winding = build(mesh, options);
    CHECK(winding.method() == "pseudonormal");
    CHECK(winding.sign() == "winding");
    CHECK(winding.signReason() == "as asked for");
}

TEST_CASE("a field from elsewhere has no history") {
    const auto grid = openvdb::ConstPtrCast<openvdb::FloatGrid>(torus().grids().distance)->deepCopy();
    grid->clearMetadata();
    grid->setGridClass(openvdb::GRID_LEVEL_SET);
    const LevelSet field(std::make_shared<Grids>(Grids{grid, nullptr}));
    CHECK(field.method().empty());
    CHECK(field.sign().empty());
    CHECK(field.signReason().empty());
    CHECK(field.signConflicts() == 0);
    CHECK(std::isnan(field.errorBound()));
}

TEST_CASE("truncated and foreign files are refused by name, wherever they are cut") {
    writeVdb(test::scratch("whole.vdb"), torus());
    const std::string whole = test::contentsOf(test::scratch("whole.vdb"));
    for (const double part : {0.0, 0.001, 0.01, 0.1, 0.5, 0.9, 0.999}) {
        const auto path = test::scratch("cut.vdb");
        std::ofstream(path, std::ios::binary) << whole.substr(0, std::size_t(part * double(whole.size())));
        CAPTURE(part);
        CHECK_THROWS_WITH(readVdb(path), Catch::Contains("cut.vdb"));
    }
    std::ofstream(test::scratch("text.vdb")) << "hello, this is no grid at all";
    CHECK_THROWS_WITH(readVdb(test::scratch("text.vdb")), Catch::Contains("text.vdb"));
    CHECK_THROWS_WITH(readVdb("/nonexistent.vdb"), Catch::Contains("/nonexistent.vdb"));
    CHECK_THROWS_WITH(writeVdb("/nonexistent/a.vdb", torus()), Catch::Contains("/nonexistent/a.vdb"));
}

TEST_CASE("a file of ours with one wrong byte, or one too few or too many, is refused before OpenVDB reads it") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    test::Random random(seed);
    writeVdb(test::scratch("whole.vdb"), torus());
    const std::string whole = test::contentsOf(test::scratch("whole.vdb"));
    const auto path = test::scratch("wrong_byte.vdb");
    for (int i = 0; i < 500; ++i) {
        const auto at = std::size_t(random(0, double(whole.size() - 23)));  // the checksum's line is 23 bytes long
        std::string wrong = whole;
        wrong[at] = char(wrong[at] ^ (1 << int(random(0, 8))));
        std::ofstream(path, std::ios::binary) << wrong;
        CAPTURE(at);
        REQUIRE_THROWS_WITH(readVdb(path), Catch::Contains("wrong_byte.vdb") && Catch::Contains("damaged"));
    }
    for (std::size_t missing = 1; missing <= 19; ++missing) {
        std::ofstream(path, std::ios::binary) << whole.substr(0, whole.size() - missing);
        CAPTURE(missing);
        REQUIRE_THROWS_WITH(readVdb(path), Catch::Contains("wrong_byte.vdb") && Catch::Contains("damaged"));
    }
    std::ofstream(path, std::ios::binary) << whole << "\n\n";
    CHECK_THROWS_WITH(readVdb(path), Catch::Contains("damaged"));
    // the checksum is optional for other programs: OpenVDB reads the file, and files that it writes have none
    openvdb::io::File file(test::scratch("whole.vdb").string());
    file.open();
    openvdb::io::File(test::scratch("again.vdb").string()).write(*file.getGrids());
    CHECK(readVdb(test::scratch("again.vdb")).grids().distance->activeVoxelCount() ==
          torus().grids().distance->activeVoxelCount());
}

TEST_CASE("A file whose voxels are too small for OpenVDB is refused by an error that names it") {
    const float voxelSize = 0.05f, tiny = 1e-6f;
    for (const bool atOrigin : {true, false}) {
        // OpenVDB makes no such grid: the sizes in the file are replaced
        const LevelSet field = build(shapes::box({1, 1, 1}), {.voxelSize = voxelSize});
        const openvdb::FloatGrid::Ptr grid = field.grids().distance->deepCopy();
        if (!atOrigin) grid->insertMeta(metadata::origin, openvdb::Vec3DMetadata({1, 2, 3}));
        const auto path = test::scratch("tiny_voxels.vdb");
        openvdb::io::File(path.string()).write({grid});
        std::string file = test::contentsOf(path);
        const auto replaceAll = [&](double from, double to) {
            const std::string old(reinterpret_cast<const char*>(&from), sizeof from);
            const std::string other(reinterpret_cast<const char*>(&to), sizeof to);
            for (std::size_t at = 0; (at = file.find(old, at)) != std::string::npos; at += sizeof to)
                file.replace(at, sizeof to, other);
        };
        replaceAll(double(voxelSize), double(tiny));
        std::ofstream(path, std::ios::binary) << file;
        CHECK_THROWS_WITH(readVdb(path), Catch::Contains("tiny_voxels.vdb: ") &&
                                             Catch::Contains(atOrigin ? "the edge of a voxel" : "damaged"));
    }
}

TEST_CASE("text from a file is short and on one line in messages") {
    CHECK(detail::quotedWord("facet") == "'facet'");
    CHECK(detail::quotedWord(std::string(1000, 'a')) == "'" + std::string(40, 'a') + "...'");
    CHECK(detail::quotedWord("a\x1b\n\xff") == std::string("'a") + "?" + "?" + "?'");
    CHECK(detail::oneLine("a\nb\t\x1b \n") == "a b");
    CHECK(detail::oneLine("\n") == "");
    CHECK(detail::oneLine(std::string(1000, 'a') + " b").size() <= 304);
}

TEST_CASE("a file without a level set is refused") {
    openvdb::initialize();
    auto fog = openvdb::FloatGrid::create(0.f);
    fog->setGridClass(openvdb::GRID_FOG_VOLUME);
    fog->tree().setValue(openvdb::Coord(1, 2, 3), 1.f);
    openvdb::io::File(test::scratch("fog.vdb").string()).write({fog});
    CHECK_THROWS_WITH(readVdb(test::scratch("fog.vdb")), Catch::Contains("no level set"));
}

namespace {

// A grid of a type, empty or with a filled box and a tile.
template <class Grid>
openvdb::GridBase::Ptr otherGrid(bool filled) {
    using Value = typename Grid::ValueType;
    const auto grid = Grid::create();
    grid->setName("other");
    if constexpr (std::is_arithmetic_v<Value> || openvdb::VecTraits<Value>::IsVec)
        if (filled) {
            grid->fill(openvdb::CoordBBox({0, 0, 0}, {20, 20, 20}), Value(1));
            grid->sparseFill(openvdb::CoordBBox({128, 0, 0}, {135, 7, 7}), Value(2));
        }
    return grid;
}

}  // namespace

TEST_CASE("A level set is read from a file that also holds a grid of another type, empty or filled") {
    openvdb::initialize();
    const LevelSet field = torus();
    const auto path = test::scratch("two_grids.vdb");
    const auto check = [&](const auto& prototype) {
        using Grid = std::decay_t<decltype(prototype)>;
        for (const bool filled : {false, true})
            for (const bool first : {false, true}) {
                CAPTURE(Grid::gridType(), filled, first);
                openvdb::GridCPtrVec grids{field.grids().distance};
                grids.insert(first ? grids.begin() : grids.end(), otherGrid<Grid>(filled));
                openvdb::io::File(path.string()).write(grids);
                CHECK(readVdb(path).activeVoxels() == field.activeVoxels());
            }
    };
    openvdb::GridTypes::foreach (std::ref(check));
}

TEST_CASE("a file with a distance that is no number is refused") {
    for (const float wrong : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
        const auto grid = openvdb::ConstPtrCast<openvdb::FloatGrid>(torus().grids().distance)->deepCopy();
        grid->tree().setValue(grid->evalActiveVoxelBoundingBox().min() + openvdb::Coord(300, 0, 0), wrong);
        openvdb::io::File(test::scratch("wrong.vdb").string()).write({grid});
        CHECK_THROWS_WITH(readVdb(test::scratch("wrong.vdb")), Catch::Contains("no finite number"));
    }
}

TEST_CASE("A file is refused whose error bound or active voxels are beyond the band") {
    const auto path = test::scratch("beyond.vdb");
    const auto written = [&](auto change) {
        const auto grid = openvdb::ConstPtrCast<openvdb::FloatGrid>(torus().grids().distance)->deepCopy();
        change(*grid);
        openvdb::io::File(path.string()).write({grid});
        return path;
    };
    const float voxel = torus().voxelSize(), width = torus().exteriorWidth();
    const auto withBound = [&](float bound) {
        return written([&](auto& grid) { grid.insertMeta(metadata::errorBound, openvdb::FloatMetadata(bound)); });
    };
    for (const float bound : {1e-4f * voxel, voxel, width}) CHECK(readVdb(withBound(bound)).errorBound() == bound);
    for (const float bound : {-1.f, 0.f, 0.9e-4f * voxel, 1.01f * width, 1e3f, 3.5e37f,
                              std::numeric_limits<float>::infinity(), std::numeric_limits<float>::quiet_NaN()}) {
        CAPTURE(bound);
        CHECK_THROWS_WITH(readVdb(withBound(bound)), Catch::Contains("bilayer:error_bound"));
    }
    for (const float distance : {1.01f * width, 1e3f, 3.5e37f}) {
        CAPTURE(distance);
        const auto change = [&](auto& grid) {
            grid.tree().setValue(grid.evalActiveVoxelBoundingBox().min(), distance);
        };
        CHECK_THROWS_WITH(readVdb(written(change)), Catch::Contains("outside, but its background is"));
    }
}

TEST_CASE("the clamped values of another program's dense array are not in the band") {
    openvdb::initialize();
    const float width = 3 * 0.1f;
    openvdb::math::CoordBBox box(openvdb::Coord(-40), openvdb::Coord(40));
    openvdb::tools::Dense<float> values(box);
    std::size_t inBand = 0;
    for (auto place = box.begin(); place; ++place) {
        const double distance = (*place).asVec3d().length() * 0.1 - 2.5;  // of a ball
        inBand += std::abs(float(distance)) < width;
        values.setValue(*place, std::clamp(float(distance), -width, width));
    }
    const auto grid = openvdb::FloatGrid::create(width);
    openvdb::tools::copyFromDense(values, *grid, 0.f);
    grid->setTransform(openvdb::math::Transform::createLinearTransform(0.1));
    grid->setGridClass(openvdb::GRID_LEVEL_SET);
    REQUIRE(grid->tree().activeTileCount() > 0);
    const auto path = test::scratch("dense.vdb");
    openvdb::io::File(path.string()).write({grid});
    const LevelSet read = readVdb(path);
    CHECK(read.activeVoxels() == inBand);
    const auto& tree = read.grids().distance->tree();
    CHECK(tree.activeTileCount() == 0);
    CHECK(tree.getValue({0, 0, 0}) == -width);
    CHECK(tree.getValue({24, 0, 0}) == Approx(-0.1));

    grid->sparseFill(openvdb::CoordBBox({64, 0, 0}, {71, 7, 7}), 0.1f);
    openvdb::io::File(path.string()).write({grid});
    CHECK_THROWS_WITH(readVdb(path),
                      Catch::Contains("an active tile of 0.1") && Catch::Contains("voxelizeActiveTiles"));
}

TEST_CASE("a rotated or empty grid is no level set to us") {
    const auto grids = [](auto change) {
        auto grid = openvdb::ConstPtrCast<openvdb::FloatGrid>(torus().grids().distance)->deepCopy();
        change(*grid);
        return std::make_shared<Grids>(Grids{grid, nullptr});
    };
    CHECK_NOTHROW(LevelSet(grids([](auto&) {})));
    CHECK_THROWS_AS(LevelSet(grids([](auto& grid) { grid.transform().postRotate(0.3, openvdb::math::X_AXIS); })),
                    std::invalid_argument);
    CHECK_THROWS_AS(LevelSet(grids([](auto& grid) { grid.transform().postScale(openvdb::Vec3d(1, 2, 1)); })),
                    std::invalid_argument);
    CHECK_THROWS_WITH(LevelSet(grids([](auto& grid) {
                          grid.transform().postTranslate({0, 0.3 * grid.voxelSize()[0], 0});
                      })),
                      Catch::Contains("shifted by 0.3 voxels along y") && Catch::Contains("field_origin"));
    CHECK_THROWS_AS(LevelSet(grids([](auto& grid) { grid.clear(); })), std::invalid_argument);
    CHECK_THROWS_AS(LevelSet(std::make_shared<Grids>()), std::invalid_argument);
}
}  // namespace bilayer::vdb_io_test
