// SPDX-License-Identifier: Apache-2.0
// `bilayer build --tiles` with the signs `auto` and `winding`: the bytes of `bilayer build`, or a refusal by name.
#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <string>

#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/mesh_io.h>
#include "demos/shared/shapes.h"
#include "tests/support/same_fields.h"
#include "tests/support/support.h"
#include "tests/tools/tile_builds.h"

namespace bilayer::tile_signs_test {
using namespace bilayer::test;

namespace fs = std::filesystem;

namespace {

fs::path fileOf(const Mesh& mesh, const std::string& name) {
    const fs::path path = scratch(name);
    writeMesh(path, mesh);
    return path;
}

// Two balls that overlap: their normals contradict each other.
Mesh overlapping() {
    return shapes::join({shapes::sphere(1, 5), shapes::moved(shapes::sphere(0.8f, 5), {0.7f, 0.3f, 0.5f})});
}

Mesh withFlippedTriangles() {
    Mesh mesh = shapes::torusKnot(2, 3, 1, 0.2f);
    for (std::size_t i = 100; i < 200; ++i) std::swap(mesh.triangles[i].x, mesh.triangles[i].y);
    return mesh;
}

void refused(const fs::path& mesh, const Words& options, const std::string& why) {
    const fs::path folder = scratch("refused");
    checkRefusal(tiled(mesh, folder, "2x2x2", options), 1, why);
    CHECK(!fs::exists(folder / "manifest.json"));
    fs::remove_all(folder);
}

const Words size{"--resolution", "150"};
const char* const tilings[] = {"1x1x1", "2x2x2", "3x1x2"};

}  // namespace

TEST_CASE("auto takes the signs of a build in one piece") {
    const fs::path clean = fileOf(shapes::torusKnot(2, 3, 1, 0.2f), "clean.ply"),
                   flipped = fileOf(withFlippedTriangles(), "flipped.ply"),
                   insideOut = fileOf(shapes::flipped(shapes::sphere(1, 5)), "inside-out.ply"),
                   crossed = fileOf(overlapping(), "overlapping.ply");
    for (const char* tiles : tilings) {
        CHECK(sameInTiles(clean, tiles, size)["signs"]["round"] == 0);
        CHECK(sameInTiles(flipped, tiles, size)["signs"]["method"] == "normals");
        CHECK(sameInTiles(insideOut, tiles, size)["signs"]["round"] == 1);
        const nlohmann::json signs = sameInTiles(crossed, tiles, size)["signs"];
        CHECK(signs["method"] == "winding");
        CHECK(signs["round"] == 1);
    }
}

TEST_CASE("winding numbers of closed meshes are built in tiles") {
    const fs::path mesh = fileOf(overlapping(), "balls.ply");
    const Words winding = joined(size, {"--sign", "winding"});
    for (const char* tiles : tilings) sameInTiles(mesh, tiles, winding);
    sameInTiles(mesh, "3x1x2", joined(winding, {"--triangles", "--exterior-width", "5", "--interior-width", "2"}));
}

// Between two thin walls, normals are wrong without a conflict.
TEST_CASE("corrected signs are built in tiles") {
    Mesh bar = shapes::box({20, 1, 1});
    for (glm::vec3& p : bar.points) p = {p.x - 0.01f * p.y, p.y + 0.01f * p.x, p.z};
    const fs::path bars =
        fileOf(shapes::join({bar, shapes::moved(shapes::box({1, 20, 1}), {0, 0.05f, 0.025f})}), "bars.ply");
    std::size_t corrected = 0;
    for (const char* resolution : {"25", "30", "40", "80"})
        for (const char* tiles : {"1x1x1", "2x1x1"})
            corrected += sameInTiles(bars, tiles, {"--resolution", resolution})["signs"]["check"] == "correct";
    CHECK(corrected > 0);
}

TEST_CASE("closed meshes that are not read whole have signs by auto and winding") {
    const fs::path mesh = fileOf(shapes::sphere(1, 8), "large.stl"), folder = scratch("large");
    for (const Words& sign : {Words{}, Words{"--sign", "winding"}}) {
        const Words options = joined({"--resolution", "160"}, sign);
        fs::remove_all(folder);
        const nlohmann::json manifest = built(tiled(mesh, folder, "4x4x4", joined(options, {"--memory", "250"})));
        CHECK(manifest["sorting"]["streamed"] == true);
        CHECK(sameTrees(*merged(folder).grids().distance, *inOnePiece(mesh, options).grids().distance));
    }
}

TEST_CASE("tiles whose signs were chosen twice are resumed") {
    const fs::path mesh = fileOf(overlapping(), "resumed.ply"), folder = scratch("resumed");
    const Words words = tiled(mesh, folder, "2x2x2", size);
    const nlohmann::json manifest = built(words);
    CHECK(manifest["signs"]["round"] == 1);
    const fs::path damaged = folder / manifest["tiles"][1]["file"].get<std::string>();
    std::ofstream(damaged, std::ios::binary) << "damaged";
    const nlohmann::json again = built(words);
    CHECK(again["signs"] == manifest["signs"]);
    CHECK(again["tiles"][0] == manifest["tiles"][0]);
    CHECK(again["tiles"][1] != manifest["tiles"][1]);
    CHECK(sameFields(merged(folder), inOnePiece(mesh, size)));
}

TEST_CASE("signs of open meshes are refused by name") {
    Mesh open = shapes::sphere(1, 5);
    open.triangles.pop_back();
    const fs::path mesh = fileOf(open, "open.ply");
    refused(mesh, joined(size, {"--sign", "winding"}),
            "open.ply: tiles have winding numbers of closed and oriented meshes only");
    refused(mesh, size, "the sign auto is winding here, because of 3 boundary edges");
    // what is not read whole cannot be oriented
    Mesh large = shapes::sphere(1, 8);
    large.triangles.pop_back();
    refused(fileOf(large, "large open.stl"), {"--resolution", "160", "--memory", "200"},
            "edges are not used equally often");
}
}  // namespace bilayer::tile_signs_test
