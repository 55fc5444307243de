// SPDX-License-Identifier: Apache-2.0
// TiledField: the samples of the merged field, from tiles that are read on demand.
#include <algorithm>
#include <atomic>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <bilayer/collider/field.h>
#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/mesh_io.h>
#include "demos/shared/shapes.h"
#include "sdf/base/openvdb.h"
#include "sdf/grid/vdb_grids.h"
#include "sdf/io/content_hash.h"
#include "tests/support/random.h"
#include "tests/support/support.h"
#include "tests/tools/tile_builds.h"

namespace bilayer::tiled_field_test {
using namespace bilayer::test;

namespace fs = std::filesystem;

namespace {

constexpr std::size_t unlimited = std::size_t(1) << 40;

// A field in tiles, and the same field in one file.
struct Tiles {
    fs::path folder;
    nlohmann::json manifest;
    LevelSet merged;
    Mesh mesh;
};

Tiles builtTiles(const std::string& name, const Mesh& mesh, const std::string& tiles, const Words& options,
                 const std::string& sign = "normals") {
    const fs::path file = scratch(name + ".ply"), folder = scratch(name);
    writeMesh(file, mesh);
    nlohmann::json manifest = built(tiled(file, folder, tiles, joined({"--sign", sign}, options)));
    return {folder, std::move(manifest), merged(folder), mesh};
}

Tiles knot(const std::string& name, const std::string& tiles, const Words& options) {
    return builtTiles(name, shapes::torusKnot(2, 3, 1, 0.2f), tiles, options);
}

bool sameBytes(const Sample& a, const Sample& b) {
    return std::memcmp(&a.distance, &b.distance, sizeof a.distance) == 0 &&
           std::memcmp(&a.gradient, &b.gradient, sizeof a.gradient) == 0 && a.inBand == b.inBand;
}

// Points everywhere, around the surface, on and next to the borders of all tiles, and far away.
std::vector<glm::vec3> queryPoints(const Tiles& tiles, std::size_t count, Random& random) {
    const Field field(tiles.merged);
    const float voxel = field.voxelSize();
    const glm::vec3 lower = field.bounds().lower, size = field.bounds().upper - lower;
    const auto unit = [&] { return float(random(0, 1)); };
    const auto anyOf = [&](std::size_t size) { return std::min(std::size_t(random(0, double(size))), size - 1); };
    std::vector<glm::vec3> points;
    while (points.size() < count) {
        const auto anywhere = [&] { return lower + (1.4f * glm::vec3(unit(), unit(), unit()) - 0.2f) * size; };
        points.push_back(anywhere());
        points.push_back(tiles.mesh.points[anyOf(tiles.mesh.points.size())] + random.point(voxel));
        const nlohmann::json& tile = tiles.manifest["tiles"][anyOf(tiles.manifest["tiles"].size())];
        glm::vec3 onBorder = anywhere();
        for (int axis = 0; axis < 3; ++axis) {
            if (unit() < 0.4f) continue;
            const char* corner = unit() < 0.5f ? "lower" : "upper";
            const float at = float(tile[corner][std::size_t(axis)].get<int>());
            const float offsets[] = {0, 1, 0.5f, -0.5f, 1e-4f, -1e-4f, 1 - 1e-4f};
            onBorder[axis] = (at + offsets[anyOf(std::size(offsets))]) * voxel;
        }
        points.push_back(onBorder);
        points.push_back(anywhere() + (100 * unit()) * size);
    }
    constexpr float infinity = std::numeric_limits<float>::infinity();
    points.push_back({infinity, 0, 0});
    points.push_back({0, std::numeric_limits<float>::quiet_NaN(), 0});
    points.push_back(glm::vec3(-std::numeric_limits<float>::max()));
    return points;
}

std::size_t differences(const std::vector<Sample>& samples, const std::vector<Sample>& truth) {
    std::size_t count = 0;
    for (std::size_t i = 0; i < samples.size(); ++i) count += !sameBytes(samples[i], truth[i]);
    return count;
}

}  // namespace

TEST_CASE("a field in tiles has the samples of the merged field") {
    Random random(seed());
    const Words exact{"--resolution", "140"}, wide{"--resolution", "110", "--half-width", "6"},
        thin{"--resolution", "150", "--half-width", "0.7"};
    const auto check = [&](const std::string& name, const std::string& counts, const Words& options, Storage storage) {
        CAPTURE(name);
        const Tiles tiles = knot(name, counts, options);
        const Field whole(tiles.merged, {storage});
        const TiledField field(tiles.folder, unlimited, {storage});
        const std::vector<glm::vec3> points = queryPoints(tiles, 20000, random);
        std::vector<Sample> truth, single, batch(points.size());
        for (const glm::vec3& point : points) {
            truth.push_back(whole.sample(point));
            single.push_back(field.sample(point));
            REQUIRE(field.inside(point) == (truth.back().distance < 0));
        }
        field.sample(points, batch);
        CHECK(differences(single, truth) == 0);
        CHECK(differences(batch, truth) == 0);
        const auto inBand = std::count_if(truth.begin(), truth.end(), [](const Sample& s) { return s.inBand; });
        CHECK(inBand > (name == "tiled thin" ? 10 : 4000));
        CHECK(field.tileCount() == tiles.manifest["tiles"].size());
        CHECK(field.tilesRead() <= field.tileCount());
        CHECK(field.voxelSize() == whole.voxelSize());
        CHECK(field.exteriorWidth() == whole.exteriorWidth());
        CHECK(field.interiorWidth() == whole.interiorWidth());
        CHECK(field.bounds().lower == whole.bounds().lower);
        CHECK(field.bounds().upper == whole.bounds().upper);
    };
    check("tiled 4x4x2", "4x4x2", exact, Storage::float32);
    check("tiled 1x1x1", "1x1x1", exact, Storage::float32);
    check("tiled fixed", "4x3x1", exact, Storage::fixed16);
    check("tiled wide", "3x3x1", wide, Storage::float32);
    check("tiled thin", "4x4x2", thin, Storage::float32);
}

TEST_CASE("tiles without leaves have a side") {
    // the tile in the middle of the sphere is all inside
    const Tiles tiles = builtTiles("tiled sphere", shapes::sphere(1, 5), "5x5x5", {"--resolution", "200"});
    const auto isEmpty = [](const nlohmann::json& tile) { return tile["file"].is_null(); };
    const nlohmann::json& all = tiles.manifest["tiles"];
    REQUIRE(std::any_of(all.begin(), all.end(), [&](const auto& t) { return isEmpty(t) && t["side"] == "inside"; }));
    REQUIRE(std::any_of(all.begin(), all.end(), [&](const auto& t) { return isEmpty(t) && t["side"] == "outside"; }));
    Random random(seed());
    const Field whole(tiles.merged);
    const TiledField field(tiles.folder, unlimited);
    for (const glm::vec3& point : queryPoints(tiles, 20000, random)) {
        CAPTURE(point.x, point.y, point.z);
        REQUIRE(sameBytes(field.sample(point), whole.sample(point)));
    }
}

TEST_CASE("tiles with signs by winding numbers or by flood have the samples of the merged field") {
    Mesh bar = shapes::box({20, 1, 1});
    for (glm::vec3& p : bar.points) p = {p.x - 0.01f * p.y, p.y + 0.01f * p.x, p.z};
    const Mesh bars = shapes::join({bar, shapes::moved(shapes::box({1, 20, 1}), {0, 0.05f, 0.025f})}),
               balls = shapes::join({shapes::sphere(1, 4), shapes::moved(shapes::sphere(0.8f, 4), {0.3f, 0.2f, 0.1f})});
    Mesh open = shapes::box({1, 1, 1}, 8);
    std::erase_if(open.triangles, [&](const glm::uvec3& t) {
        return open.points[t.x].z > 0.99f && open.points[t.y].z > 0.99f && open.points[t.z].z > 0.99f &&
               open.points[t.x].x > -0.2f;
    });
    const Tiles all[] = {
        builtTiles("tiled balls", balls, "4x4x4", {"--resolution", "160"}, "winding"),
        builtTiles("tiled auto", balls, "3x2x3", {"--resolution", "120"}, "auto"),
        builtTiles("tiled bars", bars, "2x2x1", {"--resolution", "40"}, "auto"),
        builtTiles("tiled hole", open, "3x3x4", {"--resolution", "120", "--gap", "3"}, "flood"),
        builtTiles("tiled gap", open, "2x3x3", {"--resolution", "80", "--gap", "50", "--half-width", "0.9"}, "flood")};
    Random random(seed());
    for (const Tiles& tiles : all) {
        const Field whole(tiles.merged);
        const TiledField field(tiles.folder, unlimited);
        for (const glm::vec3& point : queryPoints(tiles, 20000, random)) {
            CAPTURE(tiles.folder.string(), point.x, point.y, point.z);
            REQUIRE(sameBytes(field.sample(point), whole.sample(point)));
        }
    }
}

TEST_CASE("closest points and rays of a field in tiles are those of the merged field") {
    constexpr double tolerance = 1e-3;  // of closest points without a mesh [voxels]
    const Tiles tiles = knot("tiled rays", "4x4x2", {"--resolution", "140"});
    const Field whole(tiles.merged);
    const TiledField field(tiles.folder, unlimited);
    const float voxel = whole.voxelSize();
    Random random(seed());
    const std::vector<glm::vec3> points = queryPoints(tiles, 600, random);
    const auto closeTo = [&](float a, float b, double voxels) {
        return std::abs(a - b) <= float(voxels) * voxel + 4e-7f * std::abs(b);
    };
    std::size_t found = 0;
    for (const glm::vec3& point : points) {
        CAPTURE(point.x, point.y, point.z);
        for (const float reach : {std::numeric_limits<float>::infinity(), 3 * voxel, -1.f}) {
            const ClosestPoint expected = whole.closest(point, reach), closest = field.closest(point, reach);
            if (!closeTo(std::abs(expected.distance), reach, tolerance)) REQUIRE(closest.found == expected.found);
            if (!closest.found || !expected.found) continue;
            ++found;
            CHECK(closeTo(closest.distance, expected.distance, tolerance));
            // what was found is a zero with its own normal, whichever of equally near ones it is
            if (std::abs(closest.distance) > 1e5f * voxel) continue;
            CHECK(std::abs(whole.distance(closest.position)) <= 2e-3f * voxel);
            CHECK(glm::dot(closest.normal, whole.closest(closest.position).normal) > 0.9f);
        }
    }
    CHECK(found > 600);
    std::size_t hits = 0;
    for (std::size_t i = 0; i + 1 < points.size(); ++i) {
        CAPTURE(i);
        const Ray rays[] = {{points[i], random.direction()},
                            {points[i], points[i + 1] - points[i]},
                            {points[i], {0, 0, 1}},
                            {points[i], random.direction(), 9 * voxel}};
        for (const Ray& ray : rays) {
            const auto expected = whole.raycast(ray), hit = field.raycast(ray);
            REQUIRE(hit.has_value() == expected.has_value());
            if (!hit) continue;
            ++hits;
            CHECK(closeTo(hit->distance, expected->distance, 1e-6));
            CHECK(glm::distance(hit->position, expected->position) <= 1e-4f * voxel);
            CHECK(glm::distance(hit->normal, expected->normal) <= 1e-3f);
        }
    }
    CHECK(hits > 300);
}

TEST_CASE("tiles are read on demand and dropped beyond the budget, from several threads") {
    const Tiles tiles = knot("tiled budget", "4x4x2", {"--resolution", "200"});
    Random random(seed());
    const std::vector<glm::vec3> points = queryPoints(tiles, 4000, random);
    const Field whole(tiles.merged);
    std::vector<Sample> truth(points.size());
    whole.sample(points, truth);

    const TiledField all(tiles.folder, unlimited);
    CHECK(all.tilesRead() == 0);
    const std::size_t coarse = all.memoryBytes();
    std::vector<Sample> samples(points.size());
    all.sample(points, samples);
    const std::size_t everything = all.memoryBytes() - coarse;
    const std::size_t needed = all.tilesRead();
    CHECK(needed > 20);
    all.sample(points, samples);
    CHECK(all.tilesRead() == needed);

    // a budget of some tiles, and one that is smaller than any tile
    for (const std::size_t budget : {everything / 4, std::size_t(1)}) {
        CAPTURE(budget);
        const TiledField field(tiles.folder, budget);
        std::atomic<std::size_t> wrong = 0;
        std::vector<std::thread> threads;
        for (unsigned t = 0; t < 4; ++t)
            threads.emplace_back([&, t] {
                std::vector<Sample> own(points.size());
                if (t % 2 == 0) {
                    field.sample(points, own);
                    wrong += differences(own, truth);
                } else {
                    for (std::size_t i = t; i < points.size(); i += 97)
                        wrong += !sameBytes(field.sample(points[i]), truth[i]);
                }
            });
        for (std::thread& thread : threads) thread.join();
        CHECK(wrong == 0);
        CHECK(field.tilesRead() > needed);
        CHECK(field.memoryBytes() - coarse <= std::max(budget, everything / 8));
    }
}

TEST_CASE("a tile that is missing or damaged is an error that names its file") {
    const Tiles tiles = knot("tiled damage", "2x2x1", {"--resolution", "100"});
    const auto fileOf = [&](const char* entry, std::size_t tile) {
        return tiles.folder / tiles.manifest["tiles"][tile][entry].get<std::string>();
    };
    const auto flipByte = [](const fs::path& path) {
        std::string bytes = contents(path);
        bytes[bytes.size() / 2] ^= 1;
        std::ofstream(path, std::ios::binary) << bytes;
    };
    Random random(seed());
    const std::vector<glm::vec3> points = queryPoints(tiles, 1000, random);
    const auto messageOf = [&](const auto& call) -> std::string {
        try {
            call();
        } catch (const std::runtime_error& error) {
            return error.what();
        }
        return "no error";
    };
    const auto sampleAll = [&] {
        std::vector<Sample> samples(points.size());
        TiledField(tiles.folder, 1).sample(points, samples);
    };
    sampleAll();
    const std::string field = contents(fileOf("file", 1)), cells = contents(fileOf("cells", 2));
    flipByte(fileOf("file", 1));
    CHECK_THAT(messageOf(sampleAll), Catch::Contains(fileOf("file", 1).string() + ": is missing or damaged"));
    fs::remove(fileOf("file", 1));
    CHECK_THAT(messageOf(sampleAll), Catch::Contains(fileOf("file", 1).string() + ": is missing or damaged"));
    std::ofstream(fileOf("file", 1), std::ios::binary) << field;
    flipByte(fileOf("cells", 2));
    CHECK_THAT(messageOf(sampleAll), Catch::Contains(fileOf("cells", 2).string() + ": is missing or damaged"));
    std::ofstream(fileOf("cells", 2), std::ios::binary) << cells;
    sampleAll();
    // the folder itself
    const fs::path manifest = tiles.folder / "manifest.json";
    const std::string text = contents(manifest);
    std::ofstream(manifest, std::ios::binary) << text.substr(0, text.size() / 2);
    CHECK_THAT(messageOf(sampleAll), Catch::Contains("manifest.json: is no manifest"));
    std::ofstream(manifest, std::ios::binary)
        << R"({"field": {"tiles": [1, 2, 3]}, "mesh": {"origin": [0, 0, 0]}, "tiles": []})";
    CHECK_THAT(messageOf(sampleAll), Catch::Contains("it has 0 tiles, but states 1 x 2 x 3"));
    const auto edited = [&](const char* path, nlohmann::json value) {
        nlohmann::json all = tiles.manifest;
        all[nlohmann::json::json_pointer(path)] = std::move(value);
        std::ofstream(manifest, std::ios::binary) << all;
        return messageOf(sampleAll);
    };
    CHECK_THAT(edited("/field/tiles", {-2, -2, 1}), Catch::Contains("it has 4 tiles, but states -2 x -2 x 1"));
    CHECK_THAT(edited("/tiles/1/lower/0", 1e300), Catch::Contains("where a whole number up to 536870912 belongs"));
    CHECK_THAT(edited("/tiles/1/lower/0", 1 << 30), Catch::Contains("where a whole number up to 536870912 belongs"));
    CHECK_THAT(edited("/tiles/3/upper/1", tiles.manifest["tiles"][3]["upper"][1].get<int>() + 8),
               Catch::Contains("tile 1 1 0: its box must be of whole blocks"));
    CHECK_THAT(edited("/tiles/2/band/upper/0", 1 << 20), Catch::Contains("tile 1 0 0: its band must lie in its box"));
    CHECK_THAT(edited("/tiles/1/file", tiles.manifest["tiles"][2]["file"]), Catch::Contains("is missing or damaged"));
    for (const std::string& name :
         {std::string("../a.vdb"), std::string("\x1b]0;a\x07"), std::string(256, 'a'), std::string()})
        CHECK_THAT(edited("/tiles/1/file", name), Catch::Contains("is no name of a file in its folder"));
    // files that fit their hashes, but not each other
    const auto exchanged = [&](const char* entry, const char* hash, const auto& write) {
        const fs::path file = tiles.folder / "exchanged";
        write(file);
        nlohmann::json all = tiles.manifest;
        all["tiles"][1][entry] = "exchanged";
        all["tiles"][1][hash] = detail::fileHash(file);
        std::ofstream(manifest, std::ios::binary) << all;
        return messageOf(sampleAll);
    };
    const auto otherCells = [&](const fs::path& file) { fs::copy_file(fileOf("cells", 2), file); };
    CHECK_THAT(exchanged("cells", "cellsHash", otherCells),
               Catch::Contains("exchanged: has a block that is not in its tile"));
    const auto otherVoxels = [&](const fs::path& file) {
        const Tiles other = knot("tiled damage 2", "2x2x1", {"--resolution", "90"});
        fs::copy_file(other.folder / other.manifest["tiles"][1]["file"].get<std::string>(), file,
                      fs::copy_options::overwrite_existing);
    };
    CHECK_THAT(exchanged("file", "hash", otherVoxels), Catch::Contains("two tiles are of different fields"));
    const auto notFinite = [&](const fs::path& file) {
        const detail::TileGrids read = detail::readTile(fileOf("file", 1));
        const auto border = openvdb::ConstPtrCast<openvdb::FloatGrid>(read.border);
        border->tree().setValue(openvdb::Coord(0, 0, 0), std::nanf(""));
        writeGrids(file, {read.grids->distance, border});
    };
    CHECK_THAT(exchanged("file", "hash", notFinite), Catch::Contains("a distance that is no finite number"));
    fs::remove(manifest);
    CHECK_THAT(messageOf(sampleAll), Catch::Contains("manifest.json: no such file"));
}
}  // namespace bilayer::tiled_field_test
