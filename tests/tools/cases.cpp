// SPDX-License-Identifier: Apache-2.0
// Small files from public bug reports, in addition to the public corpus: each gives the correct result, or a one-line
// error with the reason.
#include <fmt/format.h>
#include <catch2/catch.hpp>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>
#include <sstream>

#include <bilayer/sdf/mesh_io.h>
#include "tests/support/support.h"
#include "tests/tools/program.h"

namespace bilayer::cases_test {
using namespace bilayer::test;
using nlohmann::json;

namespace {

void checkReport(const json& expected, const std::string& path) {
    const Result r = run({"inspect", path, "--json"});
    INFO(r.err);
    REQUIRE(r.status == 0);
    const json report = r.json();
    for (const char* number : {"volume", "area"})
        if (expected.contains(number))
            CHECK(report[number].get<double>() == Approx(expected[number].get<double>()).epsilon(1e-6));
    for (const char* fact : {"triangles", "closed", "oriented"})
        if (expected.contains(fact)) CHECK(report[fact] == expected[fact]);
    if (!expected.contains("bounds")) return;
    for (int axis = 0; axis < 3; ++axis) {
        CHECK(report["bounds"]["lower"][axis].get<double>() ==
              Approx(expected["bounds"][0][axis].get<double>()).margin(1e-6));
        CHECK(report["bounds"]["upper"][axis].get<double>() == Approx(expected["bounds"][1][axis].get<double>()));
    }
}

void checkNoSignal(const Result& r) {
    INFO(r.err);
    CHECK((r.status == 0 || r.status == 1));
    if (r.status == 1) CHECK(r.errorLines() == 1);
}

void checkTrianglesOrError(const json& expected, const std::string& path) {
    const Result r = run({"inspect", path, "--json"});
    checkNoSignal(r);
    if (r.status == 0)
        CHECK(r.json()["triangles"] == expected[0]);
    else
        CHECK_THAT(r.err, Catch::Contains(expected[1].get<std::string>()));
}

// Checks that a mesh file that is read builds a field with its volume and the sides of its points, and that one that is
// refused is refused by `build` too.
void checkField(const std::string& path, std::mt19937& random) {
    const std::string field = scratch("case-field.vdb").string();
    std::filesystem::remove(field);
    const Result inspected = run({"inspect", path, "--json"});
    const Result built = run({"build", path, "-o", field, "--resolution", "64"});
    checkNoSignal(built);
    REQUIRE(built.status == inspected.status);
    if (built.status != 0) {
        CHECK_FALSE(std::filesystem::exists(field));
        return;
    }
    const Result r = run({"info", field, "--json"});
    INFO(r.err);
    REQUIRE(r.status == 0);
    const json mesh = inspected.json(), info = r.json();
    if (mesh["verdict"] != "closed and oriented") return;
    CHECK(info["mass"]["volume"].get<double>() == Approx(mesh["volume"].get<double>()).epsilon(0.01));
    const Mesh read = readMesh(path);
    const Bounds box = bounds(read);
    std::string input;
    std::vector<double> expected;
    for (int i = 0; i < 40; ++i) {
        glm::dvec3 point(box.lower);
        for (int axis = 0; axis < 3; ++axis)
            point[axis] += std::uniform_real_distribution<double>(-0.1, 1.1)(random) * double(box.size()[axis]);
        expected.push_back(signedDistance(read, point));
        point += read.origin;
        input += fmt::format("{:.17g} {:.17g} {:.17g}\n", point.x, point.y, point.z);
    }
    std::istringstream distances(run({"query", field}, {.input = input}).out);
    const double voxel = double(box.longestSide()) / 64;
    for (const double distance : expected) {
        std::string line;
        REQUIRE(std::getline(distances, line));
        CAPTURE(distance, line);
        if (std::abs(distance) > voxel) CHECK(std::stod(line) * distance > 0);
    }
}

// The field's distance at a point.
double distanceAt(const json& expected, const std::string& path) {
    const std::string field = scratch("case.vdb").string();
    const Result built = run({"build", path, "-o", field, expected[0], expected[1]});
    INFO(built.err);
    REQUIRE(built.status == 0);
    const std::string point = expected[2][0].dump() + " " + expected[2][1].dump() + " " + expected[2][2].dump() + "\n";
    return std::stod(run({"query", field}, {.input = point}).out);
}

}  // namespace

TEST_CASE("files from fault reports are read right") {
    const auto list = corpusMesh("../cases/expected.json");
    if (!list) return;
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    const json cases = json::parse(std::ifstream(*list));
    CHECK(cases.size() > 20);
    for (const auto& [name, expected] : cases.items()) {
        CAPTURE(name);
        const std::string path = (list->parent_path() / name).string();
        if (expected.contains("triangles")) checkReport(expected, path);
        if (expected.contains("no_signal")) checkNoSignal(run({"inspect", path}));
        if (expected.contains("triangles_or_error")) checkTrianglesOrError(expected["triangles_or_error"], path);
        checkField(path, random);
        if (const json q = expected.value("query", json()); !q.is_null())
            CHECK(distanceAt(q, path) == Approx(q[3].get<double>()).margin(q[4].get<double>()));
        if (const json q = expected.value("query_sign", json()); !q.is_null())
            CHECK(distanceAt(q, path) * q[3].get<double>() > 0);
    }
}

TEST_CASE("a small damaged field is refused at once, and without gigabytes") {
    const auto path = corpusMesh("../cases/small-file-gigabytes.vdb");
    if (!path) return;
    const auto start = std::chrono::steady_clock::now();
    const Result r = run({"info", path->string()});
    INFO(r.err);
    CHECK(r.status == 1);
    CHECK(r.errorLines() == 1);
    CHECK(r.peakMemory < std::size_t(100) << 20);
    CHECK(std::chrono::steady_clock::now() - start < std::chrono::seconds(10));
}

TEST_CASE("a union of overlapping solids is as large as it is") {
    const auto path = corpusMesh("../cases/two-boxes-overlapping.obj");
    if (!path) return;
    const std::string field = scratch("union.vdb").string();
    REQUIRE(run({"build", path->string(), "-o", field, "--resolution", "128", "--union"}).status == 0);
    CHECK(std::stod(run({"query", field}, {.input = "0.5 0.1 0.1\n"}).out) < 0);
    CHECK(run({"info", field, "--json"}).json()["mass"]["volume"].get<double>() == Approx(1.578).epsilon(1e-3));
}
}  // namespace bilayer::cases_test
