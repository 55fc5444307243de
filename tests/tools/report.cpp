// SPDX-License-Identifier: Apache-2.0
// `bilayer inspect` and `bilayer info`: what they report of meshes and files.
#include <nanovdb/util/IO.h>
#include <openvdb/tools/LevelSetSphere.h>

#include <catch2/catch.hpp>
#include <cmath>

#include <bilayer/collider/collider.h>
#include <bilayer/sdf/mesh_io.h>
#include <bilayer/sdf/vdb_io.h>
#include "collider/contact/body/collider_data.h"
#include "demos/shared/shapes.h"
#include "sdf/base/access.h"
#include "sdf/base/openvdb.h"
#include "tests/support/support.h"
#include "tests/tools/program.h"

namespace bilayer::report_test {
using namespace bilayer::detail;
using namespace bilayer::test;

TEST_CASE("inspect reports holes") {
    Mesh open = shapes::sphere(1, 2);
    open.triangles.pop_back();
    const auto path = scratch("open.obj");
    writeMesh(path, open);
    const Result r = run({"inspect", path.string(), "--json"});
    REQUIRE(r.status == 0);
    CHECK(r.json()["boundaryEdges"] == 3);
    CHECK(r.json()["closed"] == false);
    CHECK(r.json()["triangles"] == 319);
    CHECK(run({"inspect", path.string()}).out.find("3 boundary edges") != std::string::npos);
}

TEST_CASE("info reports the contents of a file") {
    const Result r = run({"info", fieldFile(), "--json"});
    INFO(r.err);
    REQUIRE(r.status == 0);
    const auto json = r.json();
    const LevelSet field = readVdb(fieldFile());
    CHECK(json["grids"][0]["name"] == "distance");
    CHECK(json["grids"][0]["class"] == "level set");
    CHECK(json["activeVoxels"] == field.activeVoxels());
    CHECK(json["exteriorWidth"].get<double>() == Approx(3));
    CHECK(json["method"] == "exact");
    CHECK(json["sign"] == "normals");
    CHECK(json["signReason"] == "closed and oriented");
    CHECK(json["signConflicts"] == 0);
    CHECK(json["errorBound"].get<double>() == Approx(1e-4 * 0.05));
    CHECK(json["bounds"]["lower"][0].get<double>() == Approx(-0.6).margin(0.06));
    CHECK(json["meshHash"].get<std::string>().size() == 16);
    const Result table = run({"info", fieldFile()});
    CHECK(table.status == 0);
    CHECK_THAT(table.out, Catch::Contains("normals: closed and oriented") && Catch::Contains("0.0001 voxels"));
}

TEST_CASE("build --body stores the data of bodies, and info reports it") {
    const std::string output = scratch("body.vdb").string();
    const auto plain = buildSphere(output, {"--voxel-size", "0.05"});
    CHECK_FALSE(plain.contains("body"));
    CHECK_FALSE(run({"info", output, "--json"}).json().contains("body"));
    const auto json = buildSphere(output, {"--voxel-size", "0.05", "--body", "--margin", "0.02", "--report"});
    const Collider body(readVdb(output));
    CHECK(body.margin() == 0.02f);
    CHECK(body.mass().volume == Approx(json["mesh"]["volume"].get<double>()));
    CHECK(json["body"]["points"] == dataOf(body).points().points().size());
    const auto info = run({"info", output, "--json"}).json();
    CHECK(info["body"] == json["body"]);
    CHECK(info["body"]["margin"] == 0.02);
    CHECK(info["mass"] == info["body"]["mass"]);
    CHECK_THAT(run({"info", output}).out, Catch::Contains("surface points, margin 0.02 m, 1,280 triangles"));
    CHECK(info["body"]["triangles"] == json["triangles"]);
    CHECK(info["body"]["contacts"] == "exact-near-features");
    CHECK(body.mesh().triangles == readMesh(sphereFile()).triangles);
    CHECK(body.field().mesh());
    const auto fine = buildSphere(output, {"--voxel-size", "0.05", "--body", "--point-spacing", "1"});
    CHECK(fine["body"]["points"] > json["body"]["points"]);
    CHECK(fine["body"]["margin"] == 0.05);
    for (const std::string accuracy : {"exact", "samples"}) {
        const auto other = buildSphere(output, {"--voxel-size", "0.05", "--body", "--contacts", accuracy});
        CHECK(other["body"]["contacts"] == accuracy);
        CHECK(nameOf(dataOf(Collider(readVdb(output))).body.accuracy) == accuracy);
        CHECK((Collider(readVdb(output)).field().mesh() != nullptr) == (accuracy == "exact"));
        CHECK(Collider(readVdb(output)).exactField().mesh());
    }
    const auto whole = std::filesystem::file_size(output);
    CHECK(buildSphere(output, {"--voxel-size", "0.05", "--body", "--no-mesh"})["body"]["triangles"] == 0);
    CHECK_FALSE(dataOf(Collider(readVdb(output))).body.mesh);
    CHECK(std::filesystem::file_size(output) + body.mesh().triangles.size() * sizeof(glm::uvec3) < whole);
    CHECK_THAT(run({"info", output}).out, Catch::Contains("no mesh"));
    buildSphere(output, {"--voxel-size", "0.05", "--body", "--half-float", "--triangles", "--extend"});
    CHECK(dataOf(Collider(readVdb(output))).points().points().size() == dataOf(body).points().points().size());
}

TEST_CASE("inspect reports recommended settings") {
    const auto path = scratch("plate.ply");
    writeMesh(path, shapes::box({0.5f, 0.5f, 0.015f}, 4));
    const Words words{"inspect", path.string(), "--dt", "1/60", "--speed", "10"};
    const auto with = [&](Words more) {
        more.insert(more.begin(), words.begin(), words.end());
        more.push_back("--json");
        const Result r = run(more);
        INFO(r.err);
        REQUIRE(r.status == 0);
        return r.json()["advice"];
    };
    const auto advice = with({});
    CHECK(advice["voxelSize"].get<double>() == Approx(0.01));
    CHECK(advice["margin"].get<double>() == Approx(0.01));
    CHECK(advice["exteriorWidth"] == 3);
    CHECK(advice["substepsWithoutSweeps"] == 12);
    CHECK(advice["wallVoxels"].get<double>() == Approx(3));
    CHECK(advice["warnings"].size() == 1);
    CHECK(advice["splitImpulsePenetrationThreshold"].get<double>() == Approx(-0.01));
    CHECK(with({"--thickness", "0.015"})["voxelSize"].get<double>() == Approx(0.005));
    CHECK(with({"--gap", "0.01"})["voxelSize"].get<double>() == Approx(0.005));
    CHECK(with({"--voxel-size", "0.02"})["wallVoxels"].get<double>() == Approx(1.5));
    CHECK(with({"--margin", "0.02"})["exteriorWidth"] == 4);
    CHECK(with({"--spin", "100"})["substeps"] == 4);
    CHECK(with({"--mass-ratio", "50"})["warnings"].size() == 2);
    const std::string text = run(words).out;
    CHECK_THAT(text, Catch::Contains("--voxel-size 0.01 --exterior-width 3 --interior-width 10 --body --margin 0.01") &&
                         Catch::Contains("12 without") && Catch::Contains("warning"));
    CHECK_FALSE(run({"inspect", path.string(), "--json"}).json().contains("advice"));
}

TEST_CASE("inspect and info report the mass") {
    const auto mesh = run({"inspect", sphereFile().string(), "--json"}).json()["mass"];
    const auto field = run({"info", fieldFile(), "--json"}).json()["mass"];
    const double ball = 4. / 3 * 3.14159265 * 0.125;
    CHECK(mesh["volume"].get<double>() == Approx(ball).epsilon(0.02));
    CHECK(field["volume"].get<double>() == Approx(mesh["volume"].get<double>()).epsilon(5e-3));
    for (int axis = 0; axis < 3; ++axis) {
        CHECK(std::abs(field["centre"][axis].get<double>()) < 1e-3);
        CHECK(field["inertia"][axis][axis].get<double>() ==
              Approx(mesh["inertia"][axis][axis].get<double>()).epsilon(5e-3));
        CHECK(field["principalInertia"][axis].get<double>() == Approx(0.1 * ball).epsilon(0.03));
    }
    CHECK(field["principalAxes"].size() == 4);
    for (const Words& words : {Words{"inspect", sphereFile().string()}, Words{"info", fieldFile()}})
        CHECK_THAT(run(words).out, Catch::Contains("centre of mass") && Catch::Contains("principal axis 1") &&
                                       Catch::Contains("volume"));
    Mesh open = shapes::sphere(1, 2);
    open.triangles.pop_back();
    writeMesh(scratch("lidless.obj"), open);
    CHECK(run({"inspect", scratch("lidless.obj").string(), "--json"}).json()["mass"].is_null());
}

TEST_CASE("info reports bodies of any size that build accepts, and why one has no mass") {
    const auto path = scratch("tetrahedron.obj");
    const std::string output = scratch("tetrahedron.vdb").string();
    for (const float size : {1e-10f, 1e-3f, 0.1f, 1e4f, 1e8f, 1e10f, 1e13f}) {
        CAPTURE(size);
        writeMesh(path, {{{0, 0, 0}, {size, 0, 0}, {0, size, 0}, {0, 0, size}},
                         {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}}});
        const Result built = run({"build", path.string(), "-o", output, "--body", "--resolution", "12"});
        if (size < 2e-4f) {
            CHECK_THAT(built.err, Catch::Contains("scale the mesh"));
            continue;
        }
        REQUIRE(built.status == 0);
        const Result table = run({"info", output});
        CAPTURE(table.out);
        REQUIRE(table.status == 0);
        CHECK_THAT(table.out, !Catch::Contains("less than 3 voxel"));
        const auto json = run({"info", output, "--json"}).json();
        if (json["mass"].is_null())
            CHECK_THAT(table.out, Catch::Contains("beyond single precision"));
        else
            CHECK(json["mass"]["volume"].get<double>() == Approx(std::pow(double(size), 3) / 6));
        CHECK(json["mass"].is_null() == (size > 1e9f));
    }
}

TEST_CASE("info accepts fields of other programs") {
    openvdb::initialize();
    const auto grid = openvdb::tools::createLevelSetSphere<openvdb::FloatGrid>(1, openvdb::Vec3f(0), 0.1f);
    const std::string path = scratch("elsewhere.vdb").string();
    openvdb::io::File(path).write({grid});
    const auto json = run({"info", path, "--json"}).json();
    CHECK(json["method"] == "");
    CHECK(json["sign"] == "");
    CHECK(json["errorBound"].is_null());
    const Result table = run({"info", path});
    CHECK(table.status == 0);
    CHECK(table.out.find("sign") == std::string::npos);
}
}  // namespace bilayer::report_test
