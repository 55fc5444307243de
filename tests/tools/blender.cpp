// SPDX-License-Identifier: Apache-2.0
// Blender, if installed, opens the files of `bilayer`: a separate program with its own OpenVDB.
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>

#include "tests/support/support.h"
#include "tests/tools/program.h"

namespace bilayer::blender_test {
using namespace bilayer::test;

namespace {

bool hasBlender() {
    if (std::system("command -v blender >/dev/null") == 0) return true;
    WARN("Blender is not installed: skipped");
    return false;
}

// The values that blender.py finds in a file.
nlohmann::json inBlender(const std::filesystem::path& file) {
    const auto log = scratch("blender.log");
    const std::string command = "blender --background --factory-startup --python-exit-code 1 --python '" BILAYER_SCRIPT
                                "' -- '" +
                                file.string() + "' >'" + log.string() + "' 2>&1";
    const int status = std::system(command.c_str());
    const std::string said = contents(log), mark = "found ";
    INFO(said);
    REQUIRE(status == 0);
    const std::size_t begin = said.find(mark);
    REQUIRE(begin != std::string::npos);
    return nlohmann::json::parse(said.substr(begin + mark.size(), said.find('\n', begin) - begin - mark.size()));
}

constexpr double radius = 0.5, voxelSize = 0.02;

// Blender's "Volume to Mesh" shifts the extracted mesh by half a voxel along each axis, to where it draws fog.
void requireBall(const nlohmann::json& found, const std::array<double, 3>& centre) {
    CHECK(found["volume"].get<double>() == Approx(4.0 / 3.0 * 3.141592653589793 * std::pow(radius, 3)).epsilon(0.01));
    for (int axis = 0; axis < 3; ++axis) {
        const double drawn = centre[std::size_t(axis)] + voxelSize / 2;
        CHECK(found["lower"][axis].get<double>() == Approx(drawn - radius).margin(0.05 * voxelSize));
        CHECK(found["upper"][axis].get<double>() == Approx(drawn + radius).margin(0.05 * voxelSize));
    }
}

}  // namespace

TEST_CASE("Blender opens a seeded liquid and its particles where they should be") {
    if (!hasBlender()) return;
    const auto file = scratch("for_blender.vdb");
    const Result seeded = run({"seed", sphereFile("ball.ply", 5).string(), "-o", file.string(), "--voxel-size", "0.02",
                               "--translate", "3", "0", "-1", "--particles", "2"});
    INFO(seeded.err);
    REQUIRE(seeded.status == 0);
    const nlohmann::json found = inBlender(file);
    CHECK(found["grids"] == nlohmann::json{{"liquid", "FLOAT"}, {"particles", "POINTS"}});
    requireBall(found, {3, 0, -1});
}

TEST_CASE("Blender opens a field") {
    if (!hasBlender()) return;
    const auto file = scratch("field_for_blender.vdb");
    REQUIRE(run({"build", sphereFile("ball.ply", 5).string(), "-o", file.string(), "--voxel-size", "0.02"}).status ==
            0);
    const nlohmann::json found = inBlender(file);
    CHECK(found["grids"]["distance"] == "FLOAT");
    requireBall(found, {0, 0, 0});
}
}  // namespace bilayer::blender_test
