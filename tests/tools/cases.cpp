// SPDX-License-Identifier: Apache-2.0
// Small files from public bug reports, in addition to the public corpus: each gives the correct result, or a one-line
// error with the reason.
#include <catch2/catch.hpp>
#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/support/support.h"
#include "tests/tools/program.h"

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
    const json cases = json::parse(std::ifstream(*list));
    CHECK(cases.size() > 20);
    for (const auto& [name, expected] : cases.items()) {
        CAPTURE(name);
        const std::string path = (list->parent_path() / name).string();
        if (expected.contains("triangles")) checkReport(expected, path);
        if (expected.contains("no_signal")) checkNoSignal(run({"inspect", path}));
        if (expected.contains("triangles_or_error")) checkTrianglesOrError(expected["triangles_or_error"], path);
        if (const json q = expected.value("query", json()); !q.is_null())
            CHECK(distanceAt(q, path) == Approx(q[3].get<double>()).margin(q[4].get<double>()));
        if (const json q = expected.value("query_sign", json()); !q.is_null())
            CHECK(distanceAt(q, path) * q[3].get<double>() > 0);
    }
}

TEST_CASE("a union of overlapping solids is as large as it is") {
    const auto path = corpusMesh("../cases/two-boxes-overlapping.obj");
    if (!path) return;
    const std::string field = scratch("union.vdb").string();
    REQUIRE(run({"build", path->string(), "-o", field, "--resolution", "128", "--union"}).status == 0);
    CHECK(std::stod(run({"query", field}, {.input = "0.5 0.1 0.1\n"}).out) < 0);
    CHECK(run({"info", field, "--json"}).json()["mass"]["volume"].get<double>() == Approx(1.578).epsilon(1e-3));
}
