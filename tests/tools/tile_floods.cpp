// SPDX-License-Identifier: Apache-2.0
// `bilayer build --tiles` with signs by flood: the bytes of `bilayer build`, also after a run was killed.
#include <unistd.h>

#include <catch2/catch.hpp>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <random>
#include <string>
#include <vector>

#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/mesh_io.h>
#include "demos/shared/shapes.h"
#include "tests/support/same_fields.h"
#include "tests/support/support.h"
#include "tests/tools/tile_builds.h"

namespace bilayer::tile_floods_test {
using namespace bilayer::test;

namespace fs = std::filesystem;

namespace {

nlohmann::json sameAsFlood(const fs::path& mesh, const std::string& tiles, const Words& options) {
    nlohmann::json manifest = sameInTiles(mesh, tiles, options);
    CHECK(manifest["signs"]["name"] == "flood");
    return manifest;
}

// Two balls in each other with a hole in the outer one.
fs::path shellsFile() {
    Mesh outer = shapes::sphere(1, 5);
    std::erase_if(outer.triangles, [&](const glm::uvec3& t) { return outer.points[t.x].z > 0.99f; });
    const fs::path path = scratch("shells.ply");
    writeMesh(path, shapes::join({outer, shapes::sphere(0.5f, 4)}));
    return path;
}

// Runs it until a file appears.
void killWhenThere(const Words& words, const fs::path& file) {
    const pid_t process = start(words);
    for (int i = 0; i < 20000 && !fs::exists(file); ++i) ::usleep(1000);
    ::kill(process, SIGKILL);
    REQUIRE(wait(process) == 128 + SIGKILL);
}

const Words size{"--resolution", "120"}, flood{"--resolution", "120", "--sign", "flood"};
const char* const tilings[] = {"1x1x1", "2x1x1", "3x2x2"};

}  // namespace

TEST_CASE("signs by flood are built in tiles") {
    const fs::path mesh = shellsFile();
    for (const char* tiles : tilings) sameAsFlood(mesh, tiles, flood);
    sameAsFlood(mesh, "3x2x2", joined(flood, {"--gap", "20"}));
    sameAsFlood(mesh, "3x2x2", joined(flood, {"--triangles", "--exterior-width", "5", "--interior-width", "0.7"}));
}

TEST_CASE("auto chooses signs by flood for all tiles") {
    Mesh sheet = shapes::box({1, 1, 1}, 8);
    sheet.triangles.resize(128);
    const fs::path path = scratch("sheet flood.ply");
    writeMesh(path, sheet);
    for (const char* tiles : {"1x1x1", "1x2x3"}) CHECK(sameAsFlood(path, tiles, size)["signs"]["round"] == 0);
}

TEST_CASE("a mesh that is not read whole has signs by flood") {
    Mesh large = shapes::sphere(1, 8);
    large.triangles.resize(large.triangles.size() / 2);
    const fs::path mesh = scratch("large flood.stl"), folder = scratch("large flood");
    writeMesh(mesh, large);
    const Words options{"--resolution", "160", "--sign", "flood"};
    fs::remove_all(folder);
    const nlohmann::json manifest = built(tiled(mesh, folder, "4x4x4", joined(options, {"--memory", "300"})));
    CHECK(manifest["sorting"]["streamed"] == true);
    CHECK(sameTrees(*merged(folder).grids().distance, *inOnePiece(mesh, options).grids().distance));
}

TEST_CASE("a damaged tile of a flood is built again") {
    const fs::path mesh = shellsFile(), folder = scratch("flood resumed");
    fs::remove_all(folder);
    const Words words = tiled(mesh, folder, "2x2x2", flood);
    const nlohmann::json manifest = built(words);
    std::ofstream(folder / manifest["tiles"][1]["file"].get<std::string>(), std::ios::binary) << "damaged";
    const nlohmann::json again = built(words);
    CHECK(again["tiles"][0] == manifest["tiles"][0]);
    CHECK(again["tiles"][1] != manifest["tiles"][1]);
    CHECK(sameFields(merged(folder), inOnePiece(mesh, flood)));
    CHECK(built(words) == again);
    const Result other = run(tiled(mesh, folder, "2x2x2", joined(flood, {"--gap", "7"})));
    CHECK(other.status == 1);
    CHECK(other.err.find("other options") != std::string::npos);
}

TEST_CASE("a flood that was killed goes on, and finds damaged files") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    const fs::path mesh = shellsFile(), folder = scratch("flood killed");
    const Words words = tiled(mesh, folder, "3x2x2", flood);
    const LevelSet whole = inOnePiece(mesh, flood);
    for (int round = 0; round < 4; ++round) {
        fs::remove_all(folder);
        std::vector<fs::path> work;
        killWhenThere(words, folder / "work" / (round % 2 ? "tile_0_0_0.json" : "all.regions"));
        for (const auto& entry : fs::directory_iterator(folder / "work"))
            if (const auto ending = entry.path().extension(); ending == ".border" || ending == ".distances")
                work.push_back(entry.path());
        REQUIRE(!work.empty());
        const fs::path damaged = work[random() % work.size()];
        CAPTURE(damaged.string());
        const auto at = std::streamoff(random() % fs::file_size(damaged));
        std::fstream file(damaged, std::ios::binary | std::ios::in | std::ios::out);
        const char old = char(file.seekg(at).get());
        file.seekp(at).put(char(old + 1));
        file.close();
        built(words);
        CHECK(sameFields(merged(folder), whole));
    }
}
}  // namespace bilayer::tile_floods_test
