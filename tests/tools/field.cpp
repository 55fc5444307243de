// SPDX-License-Identifier: Apache-2.0
// `bilayer query`, `surface` and `export`.
#include <nanovdb/util/IO.h>
#include <catch2/catch.hpp>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <memory>
#include <sstream>

#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/mesh_io.h>
#include <bilayer/sdf/vdb_io.h>
#include "sdf/base/openvdb.h"
#include "tests/support/support.h"
#include "tests/tools/program.h"

namespace bilayer::field_test {
using namespace bilayer::test;

TEST_CASE("export writes what NanoVDB reads") {
    const std::string path = scratch("triangles.vdb").string(), output = scratch("sphere.nvdb").string();
    buildSphere(path, {"--voxel-size", "0.05", "--triangles"});
    const Result r = run({"export", path, "-o", output, "--json"});
    INFO(r.err);
    REQUIRE(r.status == 0);
    const LevelSet field = readVdb(path);
    const auto json = r.json();
    CHECK(json["output"] == output);
    CHECK(json["grids"] == nlohmann::json({"distance", "triangle"}));
    CHECK(json["activeVoxels"] == field.activeVoxels());
    CHECK(json["fileBytes"] == std::filesystem::file_size(output));
    const auto grids = nanovdb::io::readGrids(output);
    REQUIRE(grids.size() == 2);
    REQUIRE(grids[0].grid<float>());
    CHECK(grids[0].grid<float>()->tree().getValue(nanovdb::Coord(10, 0, 0)) ==
          field.grids().distance->tree().getValue(openvdb::Coord(10, 0, 0)));
    const Result table = run({"export", path, "-o", output});
    CHECK(table.status == 0);
    CHECK_THAT(table.out, Catch::Contains("distance, triangle"));
}

TEST_CASE("query answers line by line") {
    const Result r = run({"query", fieldFile()}, {.input = "0.55 0 0\n 0\t-0.45 +0\r\n0 0 0\n9 9 9"});
    INFO(r.err);
    REQUIRE(r.status == 0);
    std::istringstream lines(r.out);
    double d[4], x[4], y[4], z[4];
    int band[4];
    for (int i = 0; i < 4; ++i) REQUIRE(lines >> d[i] >> x[i] >> y[i] >> z[i] >> band[i]);
    CHECK(d[0] == Approx(0.05).margin(0.015));
    CHECK(x[0] == Approx(1).margin(0.15));
    CHECK(d[1] == Approx(-0.05).margin(0.015));
    CHECK(y[1] == Approx(-1).margin(0.15));
    CHECK(band[0] == 1);
    CHECK(band[1] == 1);
    CHECK((d[2] < 0 && band[2] == 0));
    CHECK((d[3] > 0 && band[3] == 0 && x[3] == 0));
}

TEST_CASE("Every command refuses a file whose body is damaged, and says what is wrong") {
    const std::string good = scratch("body.vdb").string(), bad = scratch("bad_body.vdb").string(),
                      output = rejectedOutput();
    buildSphere(good, {"--voxel-size", "0.05", "--body"});
    const LevelSet field = readVdb(good);
    const auto checkRefused = [&](const openvdb::GridCPtrVec& grids, const std::string& reason) {
        writeGrids(bad, grids);
        const Words commands[] = {{"info", bad},
                                  {"info", bad, "--json"},
                                  {"query", bad},
                                  {"surface", bad, "-o", output + ".ply"},
                                  {"export", bad, "-o", output + ".nvdb"},
                                  {"seed", bad, "--voxel-size", "0.05", "-o", output + ".vdb"}};
        for (const Words& command : commands) {
            const Result r = run(command, {.input = "0.55 0 0"});
            CAPTURE(command, reason, r.out, r.err);
            CHECK(r.status == 1);
            CHECK(r.out.empty());
            CHECK(r.errorLines() == 1);
            CHECK_THAT(r.err, Catch::Contains(bad) && Catch::Contains(reason));
        }
    };
    checkRefused({inWorld(field.grids().distance, field)}, "the body is damaged: it has no surface points");
    constexpr float nan = std::numeric_limits<float>::quiet_NaN();
    const auto number = [](auto value) { return std::make_shared<openvdb::TypedMetadata<decltype(value)>>(value); };
    const std::pair<const char*, openvdb::Metadata::Ptr> entries[] = {
        {"bilayer:margin", number(-1.f)},
        {"bilayer:margin", number(nan)},
        {"bilayer:margin", number(1e38f)},
        {"bilayer:volume", number(1e38)},
        {"bilayer:bounds_lower", number(nan * openvdb::Vec3s(1, 1, 1))},
        {"bilayer:principal_axes", number(openvdb::Vec4s(2, 0, 0, 0))}};
    for (const auto& [name, value] : entries) {
        const auto distance = inWorld(field.grids().distance, field);
        distance->insertMeta(name, *value);
        checkRefused({distance, field.grids().points}, name);
    }
}

TEST_CASE("surface returns the sphere") {
    for (const char* name : {"surface.ply", "surface.obj", "surface.stl"}) {
        const std::string output = scratch(name).string();
        const Result r = run({"surface", fieldFile(), "-o", output});
        INFO(r.err);
        REQUIRE(r.status == 0);
        float far = 0;
        for (const glm::vec3& p : readMesh(output).points) far = std::max(far, std::abs(glm::length(p) - 0.5f));
        CHECK(far < 0.02f);
    }
    const std::string output = scratch("offset.ply").string();
    REQUIRE(run({"surface", fieldFile(), "-o", output, "--isovalue", "0.1"}).status == 0);
    const Mesh offset = readMesh(output);
    CHECK(bounds(offset).longestSide() == Approx(1.2f).margin(0.04f));
    REQUIRE(run({"surface", fieldFile(), "-o", output, "--isovalue", "0.1", "--adaptivity", "0.5"}).status == 0);
    CHECK(readMesh(output).triangles.size() < offset.triangles.size());
}
}  // namespace bilayer::field_test
