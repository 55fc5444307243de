// SPDX-License-Identifier: Apache-2.0
// `bilayer seed`: liquids.
#include <nanovdb/util/IO.h>

#include <catch2/catch.hpp>
#include <cmath>

#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/vdb_io.h>
#include "demos/shared/shapes.h"
#include "sdf/base/openvdb.h"
#include "tests/support/support.h"
#include "tests/tools/program.h"

namespace bilayer::seed_test {
using namespace bilayer::test;

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

TEST_CASE("a liquid does not keep its body's metadata") {
    const std::string body = scratch("poured.vdb").string(), output = scratch("poured_liquid.vdb").string();
    buildSphere(body, {"--voxel-size", "0.05", "--body"});
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
}  // namespace bilayer::seed_test
