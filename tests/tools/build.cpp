// SPDX-License-Identifier: Apache-2.0
// `bilayer build`: its options, its report, and what it keeps in the file.
#include <fmt/format.h>
#include <nanovdb/util/IO.h>
#include <catch2/catch.hpp>
#include <fstream>
#include <glm/geometric.hpp>
#include <vector>

#include <bilayer/collider/collider.h>
#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/mesh_io.h>
#include <bilayer/sdf/vdb_io.h>
#include "collider/contact/body/collider_data.h"
#include "demos/shared/shapes.h"
#include "sdf/base/access.h"
#include "sdf/base/openvdb.h"
#include "tests/support/support.h"
#include "tests/tools/program.h"

namespace bilayer::build_test {
using namespace bilayer::detail;
using namespace bilayer::test;

TEST_CASE("build reports what the file then holds") {
    const std::string output = scratch("report.vdb").string();
    const auto json = buildSphere(output, {"--voxel-size", "0.05"});
    const LevelSet field = readVdb(output);
    CHECK(json["triangles"] == 1280);
    CHECK(json["voxelSize"] == 0.05);
    CHECK(json["activeVoxels"] == field.activeVoxels());
    CHECK(json["leaves"] == field.leaves());
    CHECK(json["method"] == "exact");
    CHECK(json["backend"] == "tbb");
    CHECK(json["device"].is_string());
    CHECK(json["sign"] == "normals");
    CHECK(json["signReason"] == "closed and oriented");
    CHECK(json["signConflicts"] == 0);
    CHECK(json["errorBound"].get<double>() == Approx(1e-4 * 0.05));
    for (const char* part : {"read", "build", "write"}) CHECK(json["seconds"][part].get<double>() >= 0);
    CHECK(json["seconds"]["parts"].is_object());
    CHECK(json["mesh"]["balanced"] == true);
    CHECK(json["mesh"]["points"] == 642);
    CHECK(json["file"]["vertices"] == 642);
    CHECK(json["file"]["notes"].empty());
    CHECK(json["peakRssBytes"].get<std::uint64_t>() > 1'000'000);
    CHECK(field.voxelSize() == 0.05f);
    CHECK(field.exteriorWidth() == Approx(0.15f));
}

TEST_CASE("build inspects a mesh only where a report is asked for") {
    Mesh open = shapes::sphere(1, 2);
    open.triangles.pop_back();
    const auto path = scratch("unclosed.obj"), output = scratch("unclosed.vdb");
    writeMesh(path, open);
    const Words words{"build", path.string(), "-o", output.string(), "--voxel-size", "0.1"};
    const auto with = [&](Words more) {
        more.insert(more.begin(), words.begin(), words.end());
        const Result r = run(more);
        INFO(r.err);
        REQUIRE(r.status == 0);
        return r;
    };
    const auto glance = with({"--json"}).json()["mesh"];
    CHECK(glance["balanced"] == false);
    CHECK(glance["triangles"] == 319);
    CHECK_FALSE(glance.contains("boundaryEdges"));
    const auto report = with({"--json", "--report"}).json()["mesh"];
    CHECK(report["boundaryEdges"] == 3);
    CHECK(report["wall"] == 0.1);
    CHECK_THAT(with({}).out, Catch::Contains("not balanced") && !Catch::Contains("thin walls"));
    CHECK_THAT(with({"--report"}).out, Catch::Contains("thin walls"));
}

TEST_CASE("omitted parts of a mesh file are reported") {
    const auto path = scratch("more.obj");
    std::ofstream(path) << "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nv 5 5 5\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\nf 1 2\n";
    const Words build{"build", path.string(), "-o", scratch("more.vdb").string(), "--resolution", "8"};
    for (const Words& words : {Words{"inspect", path.string()}, build})
        CHECK_THAT(run(words).out, Catch::Contains("5 vertices, 4 faces") &&
                                       Catch::Contains("1 vertex that no face uses") &&
                                       Catch::Contains("1 face with fewer than three corners"));
    const auto json = run({"inspect", path.string(), "--json"}).json();
    CHECK(json["file"]["unusedVertices"] == 1);
    CHECK(json["file"]["notes"].size() == 1);
}

TEST_CASE("a mesh far from the origin keeps its shape from file to file") {
    // a cube of 0.8 m at map coordinates
    const glm::dvec3 corner(512344.7230, 5403209.7230, 249.7230);
    const auto path = scratch("far.obj"), output = scratch("far.vdb"), again = scratch("far.ply");
    {
        std::ofstream file(path);
        const Mesh cube = shapes::box(glm::vec3(0.4f));
        for (const glm::vec3& p : cube.points)
            file << fmt::format("v {:.10f} {:.10f} {:.10f}\n", corner.x + p.x + 0.4, corner.y + p.y + 0.4,
                                corner.z + p.z + 0.4);
        for (const glm::uvec3& t : cube.triangles) file << fmt::format("f {} {} {}\n", t.x + 1, t.y + 1, t.z + 1);
    }
    const auto near = [](const nlohmann::json& place, const glm::dvec3& expected, double by) {
        return glm::distance(glm::dvec3(place[0], place[1], place[2]), expected) < by;
    };
    const auto report = run({"inspect", path.string(), "--json"}).json();
    CHECK(report["volume"].get<double>() == Approx(0.512).epsilon(1e-6));
    CHECK(near(report["bounds"]["lower"], corner, 1e-6));
    CHECK(near(report["mass"]["centre"], corner + 0.4, 1e-6));
    CHECK_FALSE(near(report["origin"], glm::dvec3(0), 1));
    REQUIRE(
        run({"build", path.string(), "-o", output.string(), "--voxel-size", "0.02", "--body", "--triangles"}).status ==
        0);
    // the transform of the file's grids contains the offset
    openvdb::initialize();
    openvdb::io::File file(output.string());
    file.open();
    const auto grids = file.getGrids();
    for (const auto& grid : *grids) {
        CAPTURE(grid->getName());
        const openvdb::Vec3d centre = grid->transform().indexToWorld(grid->evalActiveVoxelBoundingBox().getCenter());
        CHECK((centre - openvdb::Vec3d(corner.x + 0.4, corner.y + 0.4, corner.z + 0.4)).length() < 0.05);
    }
    const auto info = run({"info", output.string(), "--json"}).json();
    CHECK(near(info["mass"]["centre"], corner + 0.4, 1e-3));
    CHECK(info["origin"] == report["origin"]);
    const auto at = [&](double x, double y, double z) {
        const std::string point = fmt::format("{:.10f} {:.10f} {:.10f}\n", corner.x + x, corner.y + y, corner.z + z);
        return std::stod(run({"query", output.string()}, {.input = point}).out);
    };
    CHECK(at(0.4, 0.4, 0.83) == Approx(0.03).margin(1e-4));
    CHECK(at(0.76, 0.4, 0.4) == Approx(-0.04).margin(1e-4));
    REQUIRE(run({"surface", output.string(), "-o", again.string()}).status == 0);
    CHECK(near(run({"inspect", again.string(), "--json"}).json()["bounds"]["lower"], corner, 0.01));
    const auto liquid = scratch("far-liquid.vdb");
    CHECK(run({"seed", path.string(), "-o", liquid.string(), "--voxel-size", "0.05", "--json"})
              .json()["volume"]
              .get<double>() == Approx(0.512).epsilon(0.002));
    // the liquid keeps it too: alone and with others, moved back, and converted to a mesh
    const auto in = [&](const std::string& file, const glm::dvec3& place) {
        const std::string point = fmt::format("{:.10f} {:.10f} {:.10f}\n", place.x, place.y, place.z);
        return std::stod(run({"query", file}, {.input = point}).out);
    };
    CHECK(in(liquid.string(), corner + glm::dvec3(0.4, 0.4, 0.83)) == Approx(0.03).margin(2e-3));
    CHECK(in(liquid.string(), corner + glm::dvec3(0.76, 0.4, 0.4)) == Approx(-0.04).margin(2e-3));
    REQUIRE(run({"surface", liquid.string(), "-o", again.string()}).status == 0);
    const auto surface = run({"inspect", again.string(), "--json"}).json();
    CHECK(surface["closed"] == true);
    CHECK(surface["volume"].get<double>() == Approx(0.512).epsilon(0.02));
    const auto both = scratch("far-both.vdb").string(), back = scratch("back.vdb").string();
    REQUIRE(run({"seed", output.string(), "--into", liquid.string(), "-o", both}).status == 0);
    CHECK(in(both, corner + glm::dvec3(0.76, 0.4, 0.4)) == Approx(-0.04).margin(2e-3));
    REQUIRE(run({"seed", path.string(), "-o", back, "--voxel-size", "0.05", "--particles", "8", "--translate",
                 "-512344.7230", "-5403209.7230", "-249.7230"})
                .status == 0);
    CHECK(in(back, {0.4, 0.4, 0.83}) == Approx(0.03).margin(2e-3));
    CHECK(in(back, {0.76, 0.4, 0.4}) == Approx(-0.04).margin(2e-3));
}

TEST_CASE("build --resolution counts voxels along the longest side") {
    const auto json = buildSphere(scratch("resolution.vdb").string(), {"--resolution", "20"});
    CHECK(json["voxelSize"].get<double>() == Approx(1.0 / 20).epsilon(0.01));
}

TEST_CASE("every option of build has an effect") {
    const std::string output = scratch("options.vdb").string();
    const Words size{"--voxel-size", "0.05"};
    const auto with = [&](Words options) {
        options.insert(options.begin(), size.begin(), size.end());
        return buildSphere(output, options);
    };
    const auto plain = with({});
    CHECK(with({"--half-width", "2"})["activeVoxels"] < plain["activeVoxels"]);
    const auto wide = with({"--exterior-width", "5", "--interior-width", "1"});
    CHECK(wide["exteriorWidth"].get<double>() == Approx(5));
    CHECK(wide["interiorWidth"].get<double>() == Approx(1));
    CHECK(wide["bandUnit"] == "voxels");
    CHECK(with({"--extend"})["activeVoxels"] > plain["activeVoxels"]);
    CHECK(with({"--triangles"})["memoryBytes"] > plain["memoryBytes"]);
    CHECK(readVdb(output).grids().triangle);

    const auto phi = [&](const Words& options) {
        with(options);
        return readVdb(output).grids().distance->deepCopy();
    };
    const auto values = [](const openvdb::FloatGrid& grid) {
        std::vector<float> all;
        for (auto voxel = grid.cbeginValueOn(); voxel; ++voxel) all.push_back(*voxel);
        return all;
    };
    const auto reference = values(*phi({}));
    CHECK(values(*phi({"--threads", "1"})) == reference);
    CHECK(values(*phi({"--method", "exact", "--sign", "auto", "--gap", "2", "--backend", "tbb"})) == reference);
    const auto layers = [&](Words options) {
        options.insert(options.begin(), {"--method", "double-layer"});
        return values(*phi(options));
    };
    const auto byLayers = layers({"--sign", "auto"});
    CHECK(byLayers != reference);
    CHECK(layers({"--threads", "1"}) == byLayers);
    CHECK(layers({"--delta", "0.25"}) != byLayers);
    CHECK(layers({"--epsilon", "0.1"}) != byLayers);
    CHECK(layers({"--neighbourhood", "9"}) == byLayers);  // the band is complete for any value
    CHECK(layers({"--epsilon", "0.1", "--max-subdivision", "1"}) != layers({"--epsilon", "0.1"}));
    phi({});
    const auto full = std::filesystem::file_size(output);
    const float bound = readVdb(output).errorBound();
    const auto half = with({"--half-float"});
    CHECK(std::filesystem::file_size(output) < full);
    CHECK(readVdb(output).errorBound() > bound);
    CHECK(half["errorBound"].get<float>() == readVdb(output).errorBound());
}

TEST_CASE("widths may be given in the mesh's unit") {
    const std::string output = scratch("world.vdb").string();
    const auto voxels =
        buildSphere(output, {"--voxel-size", "0.0625", "--exterior-width", "4", "--interior-width", "2"});
    const auto world = buildSphere(output, {"--voxel-size", "0.0625", "--band-unit", "world", "--exterior-width",
                                            "0.25", "--interior-width", "0.125"});
    CHECK(world["bandUnit"] == "world");
    CHECK(world["exteriorWidth"] == 0.25);
    CHECK(world["interiorWidth"] == 0.125);
    CHECK(world["activeVoxels"] == voxels["activeVoxels"]);
    CHECK(readVdb(output).exteriorWidth() == 0.25f);
    CHECK(readVdb(output).interiorWidth() == 0.125f);
    // the band keeps its width at another resolution
    buildSphere(output, {"--resolution", "40", "--band-unit", "world", "--half-width", "0.1"});
    CHECK(readVdb(output).exteriorWidth() == Approx(0.1f));
    CHECK(readVdb(output).interiorWidth() == Approx(0.1f));
    CHECK_THAT(run({"build", "--help"}).out, Catch::Contains("--band-unit") && Catch::Contains("world"));
}

TEST_CASE("a field without gaps has no error bound") {
    const std::string output = scratch("filled.vdb").string();
    CHECK(buildSphere(output, {"--voxel-size", "0.05", "--extend"})["errorBound"].is_null());
    CHECK(run({"info", output, "--json"}).json()["errorBound"].is_null());
}

TEST_CASE("each method is reported, and both exact ones agree") {
    const std::string output = scratch("methods.vdb").string();
    const auto with = [&](const std::string& method) {
        const auto json = buildSphere(output, {"--voxel-size", "0.05", "--method", method});
        CHECK(json["method"] == method);
        CHECK(run({"info", output, "--json"}).json()["method"] == method);
        CHECK(json["sign"] == (method == "double-layer" ? "layers" : "normals"));
        CHECK(json["errorBound"].get<double>() == Approx((method == "double-layer" ? 3 : 1e-4) * 0.05));
        return readVdb(output);
    };
    const LevelSet exact = with("exact"), pseudonormal = with("pseudonormal"), layers = with("double-layer");
    // at the band's limit a voxel may be active in one and background in the other
    const auto contains = [](const LevelSet& a, const LevelSet& b) {
        const auto other = a.grids().distance->getConstAccessor();
        for (auto value = b.grids().distance->cbeginValueOn(); value; ++value)
            REQUIRE(other.getValue(value.getCoord()) == Approx(*value).margin(2e-4 * 0.05));
    };
    CHECK(exact.activeVoxels() > 5000);
    CHECK(layers.activeVoxels() > 5000);
    contains(exact, pseudonormal);
    contains(pseudonormal, exact);
}

TEST_CASE("each sign method is reported with its reason") {
    for (const std::string method : {"exact", "pseudonormal"})
        for (const std::string sign : {"normals", "winding", "flood"}) {
            const std::string output = scratch("signs.vdb").string();
            const auto json = buildSphere(output, {"--voxel-size", "0.05", "--method", method, "--sign", sign});
            CHECK(json["sign"] == sign);
            CHECK(json["signReason"] == "as asked for");
            CHECK(readVdb(output).grids().distance->tree().getValue(openvdb::Coord(0)) < 0);
        }
}

TEST_CASE("an open mesh gets another sign method, and build reports why") {
    // a sphere without the triangles around one vertex: a hole about 0.13 wide
    Mesh open = shapes::sphere(0.5f, 3);
    std::erase_if(open.triangles, [](const glm::uvec3& t) { return t.x == 0 || t.y == 0 || t.z == 0; });
    const auto path = scratch("holed.ply"), output = scratch("holed.vdb");
    writeMesh(path, open);
    const auto built = [&](Words options) {
        options.insert(options.begin(), {"build", path.string(), "-o", output.string(), "--voxel-size", "0.01"});
        const Result r = run(options);
        INFO(r.err);
        REQUIRE(r.status == 0);
        return r.out;
    };
    const auto centre = [&] { return readVdb(output).grids().distance->tree().getValue(openvdb::Coord(0)); };
    const auto json = nlohmann::json::parse(built({"--json"}));
    CHECK(json["sign"] == "winding");
    CHECK_THAT(json["signReason"].get<std::string>(), Catch::Contains("boundary edges"));
    CHECK(centre() < 0);
    CHECK_THAT(built({}), Catch::Contains("winding: ") && Catch::Contains("boundary edges"));
    CHECK_THAT(run({"info", output.string()}).out, Catch::Contains("winding: ") && Catch::Contains("boundary edges"));
    CHECK(json["hasInside"] == true);
    const std::string hollow = "note           the field has no inside";
    CHECK_THAT(built({"--sign", "flood", "--gap", "2"}), Catch::Contains(hollow));
    CHECK(centre() > 0);
    CHECK(nlohmann::json::parse(built({"--sign", "flood", "--gap", "2", "--json"}))["hasInside"] == false);
    CHECK_THAT(built({"--sign", "flood", "--gap", "25"}), !Catch::Contains(hollow));
    CHECK(centre() < 0);
}

TEST_CASE("the surface points of a body face outward for either orientation of its triangles") {
    Mesh inside = shapes::sphere(0.5f, 3);
    for (glm::uvec3& triangle : inside.triangles) std::swap(triangle.x, triangle.y);
    const auto path = scratch("inside.ply"), output = scratch("inside.vdb");
    writeMesh(path, inside);
    REQUIRE(run({"build", path.string(), "-o", output.string(), "--voxel-size", "0.05", "--body"}).status == 0);
    const Collider body(readVdb(output));
    for (const SurfacePoint& point : dataOf(body).points().points())
        REQUIRE(glm::dot(point.normal, point.position) > 0.4f);
}

TEST_CASE("build on an OpenCL device gives the same voxels") {
    const auto devices = run({"devices", "--json"}).json()["devices"];
    if (devices.empty()) {
        WARN("skipped: there is no OpenCL device");
        return;
    }
    const std::string method = GENERATE("exact", "double-layer"), mapping = GENERATE("auto", "block", "group");
    CAPTURE(method, mapping);
    const auto tbb = buildSphere(scratch("tbb.vdb").string(), {"--voxel-size", "0.1", "--method", method});
    const auto cl = buildSphere(scratch("cl.vdb").string(),
                                {"--voxel-size", "0.1", "--method", method, "--backend", "opencl", "--device",
                                 devices[0]["name"], "--device-memory", "512", "--mapping", mapping});
    CHECK(cl["backend"] == "opencl");
    CHECK(cl["device"] == devices[0]["name"]);
    CHECK(cl["method"] == method);
    CHECK(cl["sign"] == tbb["sign"]);
    CHECK(cl["activeVoxels"] == tbb["activeVoxels"]);
}

TEST_CASE("build by prisms reports no error bound") {
    const auto devices = run({"devices", "--json"}).json()["devices"];
    if (devices.empty()) {
        WARN("skipped: there is no OpenCL device");
        return;
    }
    const std::string output = scratch("prism.vdb").string();
    const auto json = buildSphere(output, {"--voxel-size", "0.05", "--method", "prism", "--backend", "opencl",
                                           "--half-width", "2", "--triangles", "--device-memory", "64"});
    CHECK(json["method"] == "prism");
    CHECK(json["backend"] == "opencl");
    CHECK(json["sign"] == "prisms");
    CHECK(json["errorBound"].is_null());
    CHECK(json["activeVoxels"] > 1000);
    CHECK(run({"info", output, "--json"}).json()["method"] == "prism");
    const LevelSet field = readVdb(output);
    REQUIRE(field.grids().triangle);
    CHECK(field.grids().triangle->activeVoxelCount() == field.activeVoxels());
    CHECK(field.grids().distance->tree().getValue(openvdb::Coord(0)) < 0);
}
}  // namespace bilayer::build_test
