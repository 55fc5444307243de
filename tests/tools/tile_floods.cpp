// SPDX-License-Identifier: Apache-2.0
// `bilayer build --tiles` with signs by flood: the bytes of `bilayer build`. Builds with any signs that were killed.
#include <unistd.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <random>
#include <set>
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

std::vector<fs::path> filesIn(const fs::path& folder) {
    std::error_code absent;
    std::vector<fs::path> files;
    for (const auto& entry : fs::directory_iterator(folder, absent)) files.push_back(entry.path());
    std::sort(files.begin(), files.end());
    return files;
}

// Runs it until a file of this kind appears in the work folder.
void killWhenThere(const Words& words, const fs::path& folder, const std::string& ending) {
    const pid_t process = start(words);
    const auto isThere = [&] {
        const std::vector<fs::path> files = filesIn(folder / "work");
        return std::any_of(files.begin(), files.end(), [&](const fs::path& f) { return f.extension() == ending; });
    };
    for (int i = 0; i < 20000 && !isThere(); ++i) ::usleep(1000);
    ::kill(process, SIGKILL);
    REQUIRE(wait(process) == 128 + SIGKILL);
}

// Changes a byte, or cuts the file.
void damage(const fs::path& path, std::mt19937& random) {
    const auto at = std::streamoff(random() % fs::file_size(path));
    if (random() % 3 == 0) return fs::resize_file(path, std::uintmax_t(at));
    std::fstream file(path, std::ios::binary | std::ios::in | std::ios::out);
    const char old = char(file.seekg(at).get());
    file.seekp(at).put(char(old + 1));
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

TEST_CASE("a build in tiles that was killed goes on, and finds damaged files of all kinds") {
    const unsigned seed = test::seed();
    const std::string sign = GENERATE("normals", "winding", "flood");
    CAPTURE(seed, sign);
    std::mt19937 random(seed);
    const Words options{"--resolution", "120", "--sign", sign};
    const fs::path mesh = sign == "flood" ? shellsFile() : scratch("torus.ply"), folder = scratch("damaged"),
                   copy = scratch("damaged copy");
    if (sign != "flood") writeMesh(mesh, shapes::torus(1, 0.4f, 96, 48));
    const Words words = tiled(mesh, folder, "3x2x2", options);
    const LevelSet whole = inOnePiece(mesh, options);
    fs::remove_all(folder);
    fs::remove_all(copy);
    killWhenThere(words, folder, ".record");
    fs::copy(folder, copy, fs::copy_options::recursive);
    std::set<std::string> kinds;
    for (const fs::path& file : filesIn(folder / "work")) kinds.insert(file.extension().string());
    CHECK(kinds.count(".triangles") == 1);
    CHECK(kinds.count(".sums") == (sign == "winding"));
    CHECK(kinds.count(".border") == (sign == "flood"));
    for (const std::string& kind : kinds) {
        std::vector<fs::path> files = filesIn(folder / "work");
        std::erase_if(files,
                      [&](const fs::path& file) { return file.extension() != kind || fs::file_size(file) == 0; });
        if (files.empty()) continue;
        const fs::path damaged = files[random() % files.size()];
        CAPTURE(damaged.string());
        damage(damaged, random);
        if (kind == ".plan") {
            checkRefusal(words, 1, "remove the folder");
            fs::remove_all(folder / "work");
        }
        built(words);
        CHECK(sameFields(merged(folder), whole));
        fs::remove_all(folder);
        fs::copy(copy, folder, fs::copy_options::recursive);
    }
}
}  // namespace bilayer::tile_floods_test
