// Every command of `bilayer` on valid input.
#include <nanovdb/util/IO.h>
#include <openvdb/tools/LevelSetSphere.h>

#include <fmt/format.h>
#include <catch2/catch.hpp>
#include <cmath>
#include <fstream>
#include <glm/geometric.hpp>
#include <sstream>
#include <vector>

#include <bilayer/collider/collider.h>
#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/mesh_io.h>
#include <bilayer/sdf/vdb_io.h>
#include "collider/contact/collider_data.h"
#include "demos/shared/shapes.h"
#include "sdf/base/openvdb.h"
#include "tests/support/support.h"
#include "tests/tools/program.h"

using namespace bilayer;
using namespace bilayer::detail;
using namespace bilayer::test;

namespace {

// A field of the sphere at voxel size 0.05, built once.
std::string fieldFile() {
    const std::string path = scratch("sphere.vdb").string();
    if (!std::filesystem::exists(path)) {
        const Result r = run({"build", sphereFile().string(), "-o", path, "--voxel-size", "0.05"});
        INFO(r.err);
        REQUIRE(r.status == 0);
    }
    return path;
}

nlohmann::json build(const std::string& output, const Words& options) {
    Words words{"build", sphereFile().string(), "-o", output, "--json"};
    words.insert(words.end(), options.begin(), options.end());
    const Result r = run(words);
    INFO(r.err);
    REQUIRE(r.status == 0);
    CHECK(r.err.empty());
    return r.json();
}

}  // namespace

TEST_CASE("help and version") {
    CHECK(run({"--help"}).status == 0);
    CHECK(run({"--version"}).out.rfind("bilayer 0.", 0) == 0);
    for (const char* command : {"build", "inspect", "info", "query", "surface", "export", "seed", "devices"}) {
        const Result r = run({command, "--help"});
        CHECK(r.status == 0);
        CHECK_FALSE(r.out.empty());
    }
}

TEST_CASE("build reports what the file then holds") {
    const std::string output = scratch("report.vdb").string();
    const auto json = build(output, {"--voxel-size", "0.05"});
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
    CHECK(json["mesh"]["closedAndOriented"] == true);
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
    CHECK(glance["closedAndOriented"] == false);
    CHECK(glance["triangles"] == 319);
    CHECK_FALSE(glance.contains("boundaryEdges"));
    const auto report = with({"--json", "--report"}).json()["mesh"];
    CHECK(report["boundaryEdges"] == 3);
    CHECK(report["wall"] == 0.1);
    CHECK_THAT(with({}).out, Catch::Contains("closed") && !Catch::Contains("thin walls"));
    CHECK_THAT(with({"--report"}).out, Catch::Contains("thin walls"));
}

TEST_CASE("what a mesh file holds beside its mesh is told") {
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

TEST_CASE("a mesh far from the zero point keeps its shape from file to file") {
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
    const auto json = build(scratch("resolution.vdb").string(), {"--resolution", "20"});
    CHECK(json["voxelSize"].get<double>() == Approx(1.0 / 20).epsilon(0.01));
}

TEST_CASE("every option of build has an effect") {
    const std::string output = scratch("options.vdb").string();
    const Words size{"--voxel-size", "0.05"};
    const auto with = [&](Words options) {
        options.insert(options.begin(), size.begin(), size.end());
        return build(output, options);
    };
    const auto plain = with({});
    CHECK(with({"--half-width", "2"})["activeVoxels"] < plain["activeVoxels"]);
    const auto wide = with({"--exterior-width", "5", "--interior-width", "1"});
    CHECK(wide["exteriorWidth"].get<double>() == Approx(5));
    CHECK(wide["interiorWidth"].get<double>() == Approx(1));
    CHECK(wide["bandUnit"] == "voxels");
    CHECK(with({"--fill"})["activeVoxels"] > plain["activeVoxels"]);
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
    const auto voxels = build(output, {"--voxel-size", "0.0625", "--exterior-width", "4", "--interior-width", "2"});
    const auto world = build(output, {"--voxel-size", "0.0625", "--band-unit", "world", "--exterior-width", "0.25",
                                      "--interior-width", "0.125"});
    CHECK(world["bandUnit"] == "world");
    CHECK(world["exteriorWidth"] == 0.25);
    CHECK(world["interiorWidth"] == 0.125);
    CHECK(world["activeVoxels"] == voxels["activeVoxels"]);
    CHECK(readVdb(output).exteriorWidth() == 0.25f);
    CHECK(readVdb(output).interiorWidth() == 0.125f);
    // the band keeps its width at another resolution
    build(output, {"--resolution", "40", "--band-unit", "world", "--half-width", "0.1"});
    CHECK(readVdb(output).exteriorWidth() == Approx(0.1f));
    CHECK(readVdb(output).interiorWidth() == Approx(0.1f));
    CHECK_THAT(run({"build", "--help"}).out, Catch::Contains("--band-unit") && Catch::Contains("world"));
}

TEST_CASE("a filled field promises no bound of its error") {
    const std::string output = scratch("filled.vdb").string();
    CHECK(build(output, {"--voxel-size", "0.05", "--fill"})["errorBound"].is_null());
    CHECK(run({"info", output, "--json"}).json()["errorBound"].is_null());
}

TEST_CASE("each method says what it did, and both exact ones agree") {
    const std::string output = scratch("methods.vdb").string();
    const auto with = [&](const std::string& method) {
        const auto json = build(output, {"--voxel-size", "0.05", "--method", method});
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

TEST_CASE("each sign says who asked for it") {
    for (const std::string method : {"exact", "pseudonormal"})
        for (const std::string sign : {"normals", "winding", "flood"}) {
            const std::string output = scratch("signs.vdb").string();
            const auto json = build(output, {"--voxel-size", "0.05", "--method", method, "--sign", sign});
            CHECK(json["sign"] == sign);
            CHECK(json["signReason"] == "as asked for");
            CHECK(readVdb(output).grids().distance->tree().getValue(openvdb::Coord(0)) < 0);
        }
}

TEST_CASE("an open mesh is signed by other means, and build says why") {
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
    built({"--sign", "flood", "--gap", "2"});
    CHECK(centre() > 0);
    built({"--sign", "flood", "--gap", "25"});
    CHECK(centre() < 0);
}

TEST_CASE("inspect tells of holes") {
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

TEST_CASE("info tells what is in a file") {
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

TEST_CASE("build --body keeps what bodies need, and info tells of it") {
    const std::string output = scratch("body.vdb").string();
    const auto plain = build(output, {"--voxel-size", "0.05"});
    CHECK_FALSE(plain.contains("body"));
    CHECK_FALSE(run({"info", output, "--json"}).json().contains("body"));
    const auto json = build(output, {"--voxel-size", "0.05", "--body", "--margin", "0.02", "--report"});
    const Collider body(readVdb(output));
    CHECK(body.margin() == 0.02f);
    CHECK(body.mass().volume == Approx(json["mesh"]["volume"].get<double>()));
    CHECK(json["body"]["points"] == body.data().points().points().size());
    const auto info = run({"info", output, "--json"}).json();
    CHECK(info["body"] == json["body"]);
    CHECK(info["body"]["margin"] == 0.02);
    CHECK(info["mass"] == info["body"]["mass"]);
    CHECK_THAT(run({"info", output}).out, Catch::Contains("surface points, margin 0.02 m, 1,280 triangles"));
    CHECK(info["body"]["triangles"] == json["triangles"]);
    CHECK(info["body"]["contacts"] == "edges");
    CHECK(body.mesh().triangles == readMesh(sphereFile()).triangles);
    CHECK(body.field().mesh());
    const auto fine = build(output, {"--voxel-size", "0.05", "--body", "--point-spacing", "1"});
    CHECK(fine["body"]["points"] > json["body"]["points"]);
    CHECK(fine["body"]["margin"] == 0.05);
    for (const std::string measure : {"triangles", "samples"}) {
        const auto other = build(output, {"--voxel-size", "0.05", "--body", "--contacts", measure});
        CHECK(other["body"]["contacts"] == measure);
        CHECK(nameOf(Collider(readVdb(output)).data().body.accuracy) == measure);
        CHECK((Collider(readVdb(output)).field().mesh() != nullptr) == (measure == "triangles"));
        CHECK(Collider(readVdb(output)).exactField().mesh());
    }
    const auto whole = std::filesystem::file_size(output);
    CHECK(build(output, {"--voxel-size", "0.05", "--body", "--no-mesh"})["body"]["triangles"] == 0);
    CHECK_FALSE(Collider(readVdb(output)).data().body.mesh);
    CHECK(std::filesystem::file_size(output) + body.mesh().triangles.size() * sizeof(glm::uvec3) < whole);
    CHECK_THAT(run({"info", output}).out, Catch::Contains("no mesh"));
    build(output, {"--voxel-size", "0.05", "--body", "--half-float", "--triangles", "--fill"});
    CHECK(Collider(readVdb(output)).data().points().points().size() == body.data().points().points().size());
}

TEST_CASE("a body's points look outward, whichever way its triangles run") {
    Mesh inside = shapes::sphere(0.5f, 3);
    for (glm::uvec3& triangle : inside.triangles) std::swap(triangle.x, triangle.y);
    const auto path = scratch("inside.ply"), output = scratch("inside.vdb");
    writeMesh(path, inside);
    REQUIRE(run({"build", path.string(), "-o", output.string(), "--voxel-size", "0.05", "--body"}).status == 0);
    const Collider body(readVdb(output));
    for (const SurfacePoint& point : body.data().points().points())
        REQUIRE(glm::dot(point.normal, point.position) > 0.4f);
}

TEST_CASE("inspect says what a scene needs") {
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

TEST_CASE("inspect and info tell the mass, each by its own means") {
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

TEST_CASE("export writes what NanoVDB reads") {
    const std::string path = scratch("triangles.vdb").string(), output = scratch("sphere.nvdb").string();
    build(path, {"--voxel-size", "0.05", "--triangles"});
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

TEST_CASE("info takes fields from elsewhere") {
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

TEST_CASE("surface gives the sphere back") {
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

TEST_CASE("seed unites inputs, moves them, and adds particles") {
    const std::string output = scratch("liquid.vdb").string(), mesh = sphereFile().string();
    const double ball = 4.0 / 3.0 * 3.14159265 * 0.125;
    const auto seeded = [&](Words words) {
        words.insert(words.begin(), "seed");
        words.insert(words.end(), {"-o", output, "--json"});
        const Result r = run(words);
        INFO(r.err);
        REQUIRE(r.status == 0);
        return r.json();
    };
    CHECK(seeded({mesh, "--voxel-size", "0.05"})["volume"].get<double>() == Approx(ball).epsilon(0.05));
    const auto moved = seeded({fieldFile(), "--into", output, "--translate", "3", "0", "0", "--rotate", "0", "0", "1",
                               "0.5", "--particles", "4", "--seed", "7"});
    CHECK(moved["volume"].get<double>() == Approx(2 * ball).epsilon(0.05));
    const double perVoxel = moved["particles"].get<double>() * 0.05 * 0.05 * 0.05 / (2 * ball);
    CHECK(perVoxel == Approx(4).epsilon(0.05));
    const auto info = run({"info", output, "--json"}).json();
    CHECK(info["grids"].size() == 2);
    CHECK(info["levelSetCheck"] == "");
    CHECK(seeded({fieldFile(), "--into", output, "--mode", "subtract", "--translate", "-0.5", "0", "0"})["volume"]
              .get<double>() == Approx(ball * (2 - 5.0 / 16)).epsilon(0.05));
    CHECK(seeded({fieldFile(), mesh})["volume"].get<double>() == Approx(ball).epsilon(0.05));
    const auto stretched = seeded({mesh, "--resolution", "10", "--half-width", "4", "--scale", "1", "3", "1"});
    CHECK(stretched["halfWidth"].get<double>() == Approx(4));
    CHECK(stretched["voxelSize"].get<double>() == Approx(0.3).epsilon(0.01));
}

TEST_CASE("a liquid does not say what its body said") {
    const std::string body = scratch("poured.vdb").string(), output = scratch("poured_liquid.vdb").string();
    build(body, {"--voxel-size", "0.05", "--body"});
    const Result r = run({"seed", sphereFile().string(), "-o", output, "--into", body, "--translate", "0.3", "0", "0"});
    INFO(r.err);
    REQUIRE(r.status == 0);
    const LevelSet liquid = readVdb(output);
    for (auto entry = liquid.grids().distance->beginMeta(); entry != liquid.grids().distance->endMeta(); ++entry)
        CHECK(entry->first.find("bilayer:") == std::string::npos);
    const auto before = run({"info", body, "--json"}).json(), after = run({"info", output, "--json"}).json();
    CHECK(before.contains("body"));
    CHECK_FALSE(after.contains("body"));
    CHECK(after["levelSetCheck"] == "");
    CHECK(liquid.meshHash() == 0);
    CHECK(liquid.method().empty());
    CHECK(std::isnan(liquid.errorBound()));
}

TEST_CASE("a liquid's volume is the same far away") {
    const std::string output = scratch("far.vdb").string();
    const auto volumeAt = [&](const char* x) {
        const Result r = run({"seed", sphereFile("ball.ply", 5).string(), "-o", output, "--voxel-size", "0.01",
                              "--translate", x, "0", "0", "--json"});
        INFO(r.err);
        REQUIRE(r.status == 0);
        return r.json()["volume"].get<double>();
    };
    CHECK(volumeAt("0") == Approx(4.0 / 3.0 * 3.14159265 * 0.125).epsilon(5e-3));
    CHECK(volumeAt("1e5") == Approx(volumeAt("0")).epsilon(1e-3));
}

TEST_CASE("devices may be none") {
    CHECK(run({"devices", "--json"}).json()["devices"].is_array());
    CHECK(run({"devices"}).status == 0);
    const Result none = run({"devices"}, {.variables = {"OCL_ICD_VENDORS=/nonexistent"}});
    CHECK(none.status == 0);
    CHECK(none.out == "no OpenCL device\n");
}

TEST_CASE("build on an OpenCL device gives the same voxels") {
    const auto devices = run({"devices", "--json"}).json()["devices"];
    if (devices.empty()) {
        WARN("skipped: there is no OpenCL device");
        return;
    }
    const std::string method = GENERATE("exact", "double-layer"), mapping = GENERATE("auto", "block", "group");
    CAPTURE(method, mapping);
    const auto tbb = build(scratch("tbb.vdb").string(), {"--voxel-size", "0.1", "--method", method});
    const auto cl =
        build(scratch("cl.vdb").string(), {"--voxel-size", "0.1", "--method", method, "--backend", "opencl", "--device",
                                           devices[0]["name"], "--device-memory", "512", "--mapping", mapping});
    CHECK(cl["backend"] == "opencl");
    CHECK(cl["device"] == devices[0]["name"]);
    CHECK(cl["method"] == method);
    CHECK(cl["sign"] == tbb["sign"]);
    CHECK(cl["activeVoxels"] == tbb["activeVoxels"]);
}

TEST_CASE("build by prisms says that nothing bounds its error") {
    const auto devices = run({"devices", "--json"}).json()["devices"];
    if (devices.empty()) {
        WARN("skipped: there is no OpenCL device");
        return;
    }
    const std::string output = scratch("prism.vdb").string();
    const auto json = build(output, {"--voxel-size", "0.05", "--method", "prism", "--backend", "opencl", "--half-width",
                                     "2", "--triangles", "--device-memory", "64"});
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
