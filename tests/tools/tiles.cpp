// SPDX-License-Identifier: Apache-2.0
// `bilayer build --tiles` and `bilayer merge`: the field of `bilayer build` in pieces, and what survives interruptions.
#include <unistd.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>

#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/mesh_io.h>
#include "demos/shared/shapes.h"
#include "tests/support/random.h"
#include "tests/support/same_fields.h"
#include "tests/support/support.h"
#include "tests/tools/gltf_triangle.h"
#include "tests/tools/tile_builds.h"

namespace bilayer::tiles_test {
using namespace bilayer::test;

namespace fs = std::filesystem;

namespace {

const Words normals{"--sign", "normals"};

Words withNormals(const fs::path& mesh, const fs::path& folder, const std::string& tiles, const Words& options) {
    return tiled(mesh, folder, tiles, joined(options, normals));
}

// The bytes of a .vdb file but for OpenVDB's random identifier at the start, and the checksum at the end.
std::string ownBytes(const fs::path& path) {
    constexpr std::size_t identifierEnd = 57, checksum = 23;
    const std::string bytes = contents(path);
    REQUIRE(bytes.size() > identifierEnd + checksum);
    return bytes.substr(identifierEnd, bytes.size() - identifierEnd - checksum);
}

fs::path largeMeshFile(const std::string& name) {
    const fs::path path = scratch(name);
    writeMesh(path, shapes::torusKnot(2, 3, 1, 0.2f));
    return path;
}

}  // namespace

TEST_CASE("merged tiles are the field that is built in one piece") {
    const fs::path mesh = largeMeshFile("knot.ply");
    const std::string tilings[] = {"1x1x1", "3x2x1", "4x4x2"};
    const Words options[] = {{"--resolution", "150"},
                             {"--voxel-size", "0.02", "--half-width", "0.1", "--band-unit", "world", "--triangles"}};
    for (const Words& some : options)
        for (const std::string& tiles : tilings) sameInTiles(mesh, tiles, joined(some, normals));
}

TEST_CASE("the double layer method is built in tiles") {
    const fs::path mesh = largeMeshFile("layers.ply"), folder = scratch("layers");
    const Words options{"--resolution", "120", "--method", "double-layer"};
    built(tiled(mesh, folder, "3x2x1", options));
    CHECK(sameFields(merged(folder), inOnePiece(mesh, options)));
}

TEST_CASE("a mesh that is not read whole gives the same leaves") {
    // memory for neither this file nor its mesh
    const Mesh sphere = shapes::sphere(1, 8);
    for (const char* name : {"streamed.stl", "streamed.ply"}) {
        CAPTURE(name);
        const fs::path mesh = scratch(name), folder = scratch(std::string("tiles of ") + name);
        writeMesh(mesh, sphere);
        const nlohmann::json manifest =
            built(withNormals(mesh, folder, "5x5x5", {"--resolution", "160", "--memory", "250"}));
        CHECK(manifest["sorting"]["streamed"] == true);
        CHECK(manifest["mesh"]["hash"].is_null());
        CHECK(manifest["mesh"]["triangles"] == sphere.triangles.size());
        CHECK(manifest["sum"]["peakRssBytes"].get<double>() < 250.0 * (1 << 20));
        const LevelSet whole = inOnePiece(mesh, {"--resolution", "160", "--sign", "normals"});
        CHECK(sameTrees(*merged(folder).grids().distance, *whole.grids().distance));
        fs::remove(mesh);
    }
}

TEST_CASE("a build that was killed continues with the missing tiles") {
    const fs::path mesh = largeMeshFile("killed.ply"), folder = scratch("killed");
    const Words words = withNormals(mesh, folder, "4x4x2", {"--resolution", "300", "--threads", "1"});
    const pid_t process = start(words);
    const auto count = [&](const std::string& ending) {
        std::error_code absent;
        std::size_t files = 0;
        for (const auto& entry : fs::directory_iterator(folder, absent)) files += entry.path().extension() == ending;
        return files;
    };
    for (int i = 0; i < 2000 && count(".vdb") < 3; ++i) ::usleep(5000);
    ::kill(process, SIGKILL);
    wait(process);
    const std::size_t before = count(".vdb");
    REQUIRE(before >= 3);
    CHECK(!fs::exists(folder / "manifest.json"));
    checkRefusal({"merge", folder.string(), "-o", scratch("killed.vdb").string()}, 1, "manifest.json: no such file");

    // existing files stay: one of the first run keeps its time
    std::map<fs::path, fs::file_time_type> times;
    for (const auto& entry : fs::directory_iterator(folder / "work"))
        if (entry.path().extension() == ".record") {
            const fs::path field = folder / (entry.path().stem().string() + ".vdb");
            if (fs::exists(field)) times[field] = fs::last_write_time(field);
        }
    REQUIRE(!times.empty());
    const fs::path work = scratch("killed_work");
    fs::copy(folder / "work", work, fs::copy_options::recursive);
    built(words);
    for (const auto& [path, time] : times) CHECK(fs::last_write_time(path) == time);
    const LevelSet whole = inOnePiece(mesh, {"--resolution", "300", "--sign", "normals"});
    CHECK(sameFields(merged(folder), whole));

    // a run that is killed at its end leaves the manifest and the records
    for (const bool isDamaged : {false, true}) {
        fs::copy(work, folder / "work", fs::copy_options::recursive);
        if (isDamaged) std::ofstream(times.begin()->first) << "damaged";
        built(words);
        CHECK(!fs::exists(folder / "work"));
        CHECK(sameFields(merged(folder), whole));
    }
}

TEST_CASE("one process at a time builds the tiles of a folder") {
    const fs::path mesh = largeMeshFile("alone.ply"), folder = scratch("alone");
    const Words words = withNormals(mesh, folder, "4x4x2", {"--resolution", "300", "--threads", "1"});
    const pid_t process = start(words);
    for (int i = 0; i < 2000 && !fs::exists(folder / "work"); ++i) ::usleep(5000);
    checkRefusal(words, 1, "another process builds these tiles");
    CHECK(wait(process) == 0);
    CHECK(sameFields(merged(folder), inOnePiece(mesh, {"--resolution", "300", "--sign", "normals"})));
}

TEST_CASE("tiles whose records would not fit are refused") {
    const fs::path mesh = scratch("box.ply"), folder = scratch("too many tiles");
    writeMesh(mesh, shapes::box({1, 1, 1}));
    checkRefusal(withNormals(mesh, folder, "40x40x40", {"--resolution", "1300", "--memory", "200"}), 1,
                 "the records of 64000 tiles need about");
}

TEST_CASE("an output that cannot be a folder is refused by its name") {
    const fs::path mesh = scratch("box.ply"), file = scratch("a file");
    writeMesh(mesh, shapes::box({1, 1, 1}));
    std::ofstream(file) << "text";
    checkRefusal(withNormals(mesh, file, "2x1x1", {"--resolution", "100"}), 1, "a file: Not a directory");
    checkRefusal(withNormals(mesh, file / "inside", "2x1x1", {"--resolution", "100"}), 1, "inside: Not a directory");
}

TEST_CASE("a tile with a wrong byte is found and built again") {
    const fs::path mesh = largeMeshFile("byte.ply"), folder = scratch("byte");
    const Words words = withNormals(mesh, folder, "2x2x1", {"--resolution", "100"});
    const nlohmann::json manifest = built(words);
    const fs::path damaged = folder / manifest["tiles"][1]["file"].get<std::string>();
    const fs::path removed = folder / manifest["tiles"][2]["file"].get<std::string>();
    const std::string bytes = ownBytes(damaged), others = ownBytes(removed);
    std::string wrong = contents(damaged);
    wrong[wrong.size() / 2] ^= 1;
    std::ofstream(damaged, std::ios::binary) << wrong;
    fs::remove(removed);
    checkRefusal({"merge", folder.string(), "-o", scratch("byte.vdb").string()}, 1,
                 damaged.filename().string() + ": is missing or damaged");
    CHECK(!fs::exists(scratch("byte.vdb")));
    const nlohmann::json again = built(words);
    CHECK(ownBytes(damaged) == bytes);
    CHECK(ownBytes(removed) == others);
    CHECK(again["tiles"][0] == manifest["tiles"][0]);
    // nothing is missing: nothing is built
    CHECK(built(words)["tiles"] == again["tiles"]);

    const std::string text = contents(folder / "manifest.json");
    const unsigned start = seed();
    CAPTURE(start);
    Random random(start);
    for (int i = 0; i < 20; ++i) {
        std::string changed = text;
        const auto at = std::size_t(random(0, double(text.find("\n \"hash\""))));
        changed[at] = char(changed[at] ^ 1);
        std::ofstream(folder / "manifest.json") << changed;
        CAPTURE(at);
        checkRefusal({"info", folder.string()}, 1, "manifest.json: is no manifest of tiles");
        checkRefusal(words, 1, "manifest.json: is no manifest of tiles");
    }
}

TEST_CASE("A folder of tiles is described and queried like a file") {
    const fs::path mesh = largeMeshFile("described.ply"), folder = scratch("described");
    const Words size{"--resolution", "100"};
    const nlohmann::json manifest = built(withNormals(mesh, folder, "2x2x1", size));
    CHECK(nlohmann::json::parse(run({"info", folder.string(), "--json"}).out) == manifest);
    const std::string text = run({"info", folder.string()}).out;
    for (const char* row : {"3 voxels outside, 3 inside", "2 x 2 x 1, 4 of them with leaves", "normals: "})
        CHECK_THAT(text, Catch::Contains(row));
    const fs::path file = scratch("described.vdb");
    REQUIRE(run({"merge", folder.string(), "-o", file.string()}).status == 0);
    const std::string points = "1.1 0 0\n0 1.2 0.1\n-1 0.3 0\n7 7 7\n";
    const Result ofFolder = run({"query", folder.string()}, {.input = points});
    CHECK(ofFolder.status == 0);
    CHECK(ofFolder.out == run({"query", file.string()}, {.input = points}).out);

    checkRefusal({"surface", folder.string(), "-o", scratch("described_surface.ply").string()}, 1, "bilayer merge");
    checkRefusal({"info", scratch("no_tiles").string()}, 1, "no_tiles");
    std::ofstream(folder / "manifest.json") << "{}";
    checkRefusal({"info", folder.string()}, 1, "manifest.json");
}

TEST_CASE("memory is stated and kept, or the build is refused before its first tile") {
    const fs::path mesh = largeMeshFile("memory.ply"), folder = scratch("memory");
    const Words size{"--resolution", "500"};
    checkRefusal(withNormals(mesh, folder, "1x1x1", joined(size, {"--memory", "155"})), 1,
                 "the largest of 1 tiles needs about");
    CHECK(!fs::exists(folder / "tile_0_0_0.vdb"));
    // a folder without tiles may get others
    const nlohmann::json manifest = built(withNormals(mesh, folder, "4x4x2", joined(size, {"--memory", "300"})));
    const double stated = manifest["sum"]["estimatedBytes"];
    CHECK(manifest["sum"]["peakRssBytes"].get<double>() < stated);
    CHECK(stated < 300.0 * (1 << 20));
    const fs::path object = scratch("memory.obj");
    writeMesh(object, shapes::sphere(1, 8));
    checkRefusal(withNormals(object, scratch("object"), "2x2x2", {"--resolution", "50", "--memory", "130"}), 1,
                 "reading it whole needs about");
    // 30 nodes share 100,000 triangles
    writeGltf(object.parent_path(), "memory", 100'000, 30);
    std::ofstream(scratch("memory.bin"));
    fs::resize_file(scratch("memory.bin"), 3'600'000);
    checkRefusal(
        withNormals(scratch("memory.gltf"), scratch("scene"), "2x2x2", {"--resolution", "50", "--memory", "400"}), 1,
        "reading it whole needs about");
}

TEST_CASE("A .gltf file with changed buffers is another mesh, in tiles too") {
    const fs::path mesh = scratch("triangle.gltf"), folder = scratch("triangle");
    writeGltf(mesh.parent_path(), "triangle", 1, 1);
    writeGltfTriangle(mesh.parent_path(), "triangle", 1);
    const Words words = tiled(mesh, folder, "2x1x1", {"--resolution", "100", "--sign", "flood"});
    built(words);
    writeGltfTriangle(mesh.parent_path(), "triangle", 0.5f);
    checkRefusal(words, 1, "holds tiles of another mesh or with other options");
}

TEST_CASE("Triangles of voxels whose signs are found again are those of a field in one piece") {
    const Mesh ball = shapes::sphere(1, 3);
    Mesh both = ball;
    for (const glm::vec3& point : ball.points) both.points.push_back(point + glm::vec3(0.9f, 0.2f, 0.1f));
    for (const glm::uvec3& t : ball.triangles) both.triangles.push_back(t + glm::uvec3(ball.points.size()));
    const fs::path mesh = scratch("overlap.ply");
    writeMesh(mesh, both);
    for (const char* sign : {"auto", "winding"})
        sameInTiles(mesh, "2x2x1", {"--resolution", "90", "--sign", sign, "--triangles"});
}

TEST_CASE("tiles refuse what needs the whole field, by name") {
    const fs::path mesh = sphereFile(), folder = scratch("refused");
    const auto refused = [&](const Words& options, const std::string& culprit, int status = 2) {
        const Words words{"build", mesh.string(), "-o", folder.string(), "--tiles", "2x1x1", "--voxel-size", "0.01"};
        checkRefusal(joined(words, options), status, culprit);
        CHECK(!fs::exists(folder));
    };
    refused({"--method", "pseudonormal", "--sign", "normals"}, "tiles have no method pseudonormal");
    refused(joined(normals, {"--union"}), "tiles have no union");
    refused(joined(normals, {"--body"}), "--body: is not for --tiles");
    refused(joined(normals, {"--extend"}), "--extend: is not for --tiles");
    refused(joined(normals, {"--half-float"}), "--half-float: is not for --tiles");
    refused(joined(normals, {"--report"}), "--report: is not for --tiles");
    checkRefusal({"build", mesh.string(), "-o", folder.string(), "--voxel-size", "0.01", "--memory", "100"}, 2,
                 "--tiles");
    for (const char* tiles : {"2", "2x2", "0x1x1", "2x2x2x2", "axbxc"}) {
        CAPTURE(tiles);
        checkRefusal(withNormals(mesh, folder, tiles, {"--voxel-size", "0.01"}), 2, "three counts");
    }
    checkRefusal(withNormals(mesh, folder, "90x1x1", {"--voxel-size", "0.01"}), 1, "90 tiles along x");
    fs::remove_all(folder);
    built(withNormals(mesh, folder, "2x1x1", {"--voxel-size", "0.01"}));
    checkRefusal(withNormals(mesh, folder, "2x1x1", {"--voxel-size", "0.02"}), 1,
                 "holds tiles of another mesh or with other options");
}
}  // namespace bilayer::tiles_test
