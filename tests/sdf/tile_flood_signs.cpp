// SPDX-License-Identifier: Apache-2.0
// Signs of tiles by flood: leaf by leaf, the bytes of fields in one piece.
#include "sdf/tiles/flood_tile.h"

#include <bilayer/sdf/build.h>

#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <glm/gtc/quaternion.hpp>
#include <random>
#include <string>
#include <vector>

#include <bilayer/sdf/grids.h>
#include "demos/shared/shapes.h"
#include "sdf/tiles/flood_regions.h"
#include "sdf/tiles/hashed_record.h"
#include "sdf/tiles/tile_merge.h"
#include "sdf/tiles/tile_signs.h"
#include "tests/support/same_fields.h"
#include "tests/support/support.h"

namespace bilayer::tile_flood_signs_test {
using namespace bilayer::detail;
using bilayer::test::sameFields;
using Catch::Contains;

namespace {

// A field in tiles, as its ranks build it. All but the distances of the tiles passes through files.
class TiledFlood {
  public:
    TiledFlood(const Mesh& mesh, const BuildOptions& options, const glm::ivec3& counts)
        : mesh_(decideSigns(mesh, options, 0, [] {})),
          options_(optionsWith(options, mesh_.signs)),
          tiling_(bounds(mesh), options_, counts) {
        REQUIRE(mesh_.signs.method == Sign::flood);
        const double voxelsPerUnit = 1.0 / double(options.voxelSize);
        triangles_.resize(tiling_.size());
        mesh_.source->forEach([&](std::span<const TileTriangle> batch) {
            for (const TileTriangle& t : batch) {
                const auto at = [&](int k) { return glm::dvec3(t.corners[k]) * voxelsPerUnit; };
                tiling_.forEachTileOf({at(0), at(1), at(2)}, [&](std::size_t tile) { triangles_[tile].push_back(t); });
            }
        });
        for (std::size_t tile = 0; tile < tiling_.size(); ++tile) addBorder(tile);
        sides_ = joinRegions(tiling_, [this](std::size_t tile) { return borders_[tile]; });
        byDistance_.resize(tiling_.size());
        byTriangles_.resize(tiling_.size());
        rounds_ += grow(byDistance_, false);
        rounds_ += grow(byTriangles_, true);
    }

    LevelSet merged() {
        TileMerger merger;
        for (std::size_t tile = 0; tile < tiling_.size(); ++tile) {
            if (!grids_[tile]) continue;
            FloodTile flood = load(tile);
            flood.growByDistance();
            flood.growByTriangles(trianglesOf(tile));
            if (const BuiltTile built = flood.signedTile(); built.grids) merger.add(*built.grids);
        }
        return merger.merged();
    }

    int rounds() const { return rounds_; }

  private:
    void addBorder(std::size_t tile) {
        grids_.push_back(
            buildTile(triangles_[tile], mesh_.source->facts(), tiling_, tile, options_, mesh_.signs).grids);
        if (!grids_.back()) return borders_.push_back(emptyBorder(tiling_.own(tile)));
        const std::filesystem::path file = test::scratch("tile.border");
        writeBorder(file, FloodTile(grids_[tile], tiling_, tile, options_).border(), "hash");
        std::string hash;
        borders_.push_back(readBorder(file, &hash));
        CHECK(hash == "hash");
    }

    bool touch(std::size_t a, std::size_t b) const {
        const glm::ivec3 away = glm::abs(tiling_.place(a) - tiling_.place(b));
        return std::max({away.x, away.y, away.z}) == 1;
    }

    FloodTile load(std::size_t tile) {
        FloodTile flood(grids_[tile], tiling_, tile, options_);
        flood.setSides(sides_[tile]);
        for (std::size_t other = 0; other < tiling_.size(); ++other)
            if (touch(tile, other))
                flood.add({borders_[other], sides_[other], byDistance_[other], byTriangles_[other]});
        return flood;
    }

    // A tile may improve in the first round, and after a neighbour has.
    bool isDue(const std::vector<int>& last, std::size_t tile, int round) const {
        if (round == 0) return true;
        for (std::size_t other = 0; other < tiling_.size(); ++other)
            if (touch(tile, other) && last[other] + 1 >= round) return true;
        return false;
    }

    // Returns the count of rounds in which a tile improved.
    int grow(std::vector<std::vector<BorderArrival>>& all, bool byTriangles) {
        std::vector<int> last(tiling_.size(), -1);  // rounds in which the tiles improved
        for (int round = 0;; ++round) {
            bool improved = false;
            for (std::size_t tile = 0; tile < tiling_.size(); ++tile) {
                if (!grids_[tile] || !isDue(last, tile, round)) continue;
                FloodTile flood = load(tile);
                std::vector<BorderArrival> arrivals = flood.growByDistance();
                if (byTriangles) arrivals = flood.growByTriangles(trianglesOf(tile));
                if (arrivals == all[tile]) continue;
                improved = true;
                last[tile] = round;
                all[tile] = std::move(arrivals);
            }
            if (!improved) return round;
        }
    }

    WindingNumber trianglesOf(std::size_t tile) const {
        return WindingNumber(meshOf(triangles_[tile], mesh_.source->facts().origin));
    }

    SignedSource mesh_;
    BuildOptions options_;
    Tiling tiling_;
    int rounds_ = 0;
    std::vector<std::vector<TileTriangle>> triangles_;
    std::vector<std::shared_ptr<Grids>> grids_;
    std::vector<FloodBorder> borders_;
    std::vector<RegionSides> sides_;
    std::vector<std::vector<BorderArrival>> byDistance_, byTriangles_;
};

// Returns the rounds that the tiles needed.
// @param counts  of tiles, or as many as there is room for
int checkSame(const Mesh& mesh, const BuildOptions& options, glm::ivec3 counts) {
    const LevelSet whole = build(mesh, options);
    const Tiling one(bounds(mesh), optionsWith(options, {.method = Sign::flood}), {1, 1, 1});
    counts = glm::min(counts, (one.lattice().end - one.lattice().first) / one.brickSide());
    CAPTURE(counts.x, counts.y, counts.z, options.voxelSize, options.gapVoxels, options.exteriorWidthVoxels,
            options.interiorWidthVoxels, whole.sign(), whole.signReason());
    TiledFlood tiles(mesh, options, counts);
    CHECK(sameFields(tiles.merged(), whole));
    return tiles.rounds();
}

const glm::ivec3 tilings[] = {{1, 1, 1}, {2, 1, 1}, {3, 2, 2}, {1, 2, 5}};

glm::quat anyRotation(std::mt19937& random) {
    std::normal_distribution<float> normal;
    return glm::normalize(glm::quat(normal(random), normal(random), normal(random), normal(random)));
}

Mesh rotated(Mesh mesh, const glm::quat& by) {
    for (glm::vec3& p : mesh.points) p = by * p;
    return mesh;
}

// Without a share of its triangles, and with others flipped.
Mesh damaged(Mesh mesh, std::mt19937& random, unsigned percent) {
    std::erase_if(mesh.triangles, [&](const glm::uvec3&) { return random() % 100 < percent; });
    for (glm::uvec3& t : mesh.triangles)
        if (random() % 2) std::swap(t.y, t.z);
    return mesh;
}

// Solids that may lie in each other, with holes and flipped triangles.
Mesh randomShells(std::mt19937& random) {
    std::uniform_real_distribution<float> place(-0.5f, 0.5f), size(0.2f, 1.f);
    std::vector<Mesh> parts;
    for (int i = 1 + int(random() % 5); i > 0; --i) {
        const Mesh part = random() % 2 ? shapes::sphere(size(random), 4)
                                       : rotated(shapes::box({size(random), size(random), 0.2f * size(random)}, 4),
                                                 anyRotation(random));
        parts.push_back(shapes::moved(part, {place(random), place(random), place(random)}));
    }
    return damaged(shapes::join(parts), random, random() % 3);
}

// Triangles of all sizes at random.
Mesh randomSoup(std::mt19937& random) {
    std::uniform_real_distribution<float> place(-1.f, 1.f), size(0.05f, 0.8f);
    Mesh mesh;
    for (unsigned i = 0; i < 150; ++i) {
        const glm::vec3 at(place(random), place(random), place(random));
        const float side = size(random);
        for (int k = 0; k < 3; ++k)
            mesh.points.push_back(at + side * glm::vec3(place(random), place(random), place(random)));
        mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
    }
    return mesh;
}

void addQuad(Mesh& mesh, const glm::vec3& at, const glm::vec3& u, const glm::vec3& v) {
    const auto n = unsigned(mesh.points.size());
    for (const glm::vec3& p : {at, at + u, at + u + v, at + v}) mesh.points.push_back(p);
    mesh.triangles.push_back({n, n + 1, n + 2});
    mesh.triangles.push_back({n, n + 2, n + 3});
}

// A box with walls of no thickness. One path winds from an opening in a corner of it to the last room; all of the
// corridors are `width` wide.
Mesh maze(float width, int corridors, bool isOpen) {
    const float length = width * float(corridors);
    const glm::vec3 x(length, 0, 0), y(0, length, 0), z(0, 0, length);
    Mesh mesh;
    addQuad(mesh, {0, 0, 0}, x, y);
    addQuad(mesh, z, x, y);
    addQuad(mesh, {0, 0, 0}, y, z);
    addQuad(mesh, x, y, z);
    addQuad(mesh, y, x, z);
    addQuad(mesh, isOpen ? glm::vec3(width, 0, 0) : glm::vec3(0), isOpen ? x - glm::vec3(width, 0, 0) : x, z);
    for (int i = 1; i < corridors; ++i)  // doors at both ends by turns
        addQuad(mesh, {width * float(i), i % 2 ? 0.f : width, 0}, y - glm::vec3(0, width, 0), z);
    return mesh;
}

}  // namespace

TEST_CASE("tiles have the bytes of a flood through the whole mesh") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    for (int round = 0; round < 6; ++round) {
        const Mesh mesh = round % 2 ? randomSoup(random) : randomShells(random);
        const float gap = float(random() % 7);
        const BuildOptions options{.voxelSize = voxelSizeFor(mesh, 90.f + float(random() % 60)),
                                   .exteriorWidthVoxels = round % 4 == 3 ? 0.7f : 3,
                                   .interiorWidthVoxels = round % 3 == 2 ? 1.5f : 3,
                                   .sign = Sign::flood,
                                   .gapVoxels = gap,
                                   .triangles = round % 3 == 0};
        CAPTURE(round);
        for (const glm::ivec3& counts : tilings) checkSame(mesh, options, counts);
    }
}

TEST_CASE("a path from outside winds through all tiles") {
    for (const bool isOpen : {true, false})
        for (const float gap : {2.f, 6.f}) {
            const Mesh mesh = rotated(maze(0.1f, 9, isOpen), glm::angleAxis(0.03f, glm::vec3(1, 2, 3)));
            const BuildOptions options{.voxelSize = 0.01f, .sign = Sign::flood, .gapVoxels = gap};
            CAPTURE(isOpen);
            for (const glm::ivec3& counts : {glm::ivec3(2, 1, 1), glm::ivec3(3, 2, 2)})
                checkSame(mesh, options, counts);
        }
}

// The ball does not fit into the corridors, so that the flood grows through them voxel by voxel.
TEST_CASE("a flood grows through many tiles step by step") {
    const Mesh mesh = rotated(maze(0.045f, 9, true), glm::angleAxis(0.02f, glm::vec3(3, 2, 1)));
    const BuildOptions options{.voxelSize = 0.01f, .sign = Sign::flood, .gapVoxels = 8};
    CHECK(checkSame(mesh, options, {1, 1, 1}) <= 2);
    CHECK(checkSame(mesh, options, {3, 3, 1}) > 4);
    CHECK(build(mesh, options).activeVoxels() > 0);
}

TEST_CASE("auto chooses a flood for tiles as for the whole mesh") {
    Mesh sheet = shapes::box({1, 1, 1}, 8);
    sheet.triangles.resize(128);
    const BuildOptions options{.voxelSize = voxelSizeFor(sheet, 100), .gapVoxels = 4};
    CHECK(build(sheet, options).sign() == "flood");
    for (const glm::ivec3& counts : tilings) checkSame(sheet, options, counts);
}

// A gap wider than the band is closed where no voxel is active.
TEST_CASE("tiles in a closed gap have space on both sides") {
    Mesh box = shapes::box({1, 1, 1}, 1);
    box.triangles.resize(10);
    for (const float gap : {0.f, 45.f}) {
        const BuildOptions options{.voxelSize = 0.05f,
                                   .exteriorWidthVoxels = 0.6f,
                                   .interiorWidthVoxels = 0.8f,
                                   .sign = Sign::flood,
                                   .gapVoxels = gap};
        for (const glm::ivec3& counts : tilings) checkSame(box, options, counts);
    }
}

TEST_CASE("regions of tiles are joined across faces") {
    // three tiles along x; the region in the middle is open only through the last tile
    const Mesh mesh = shapes::box({1, 1, 1});
    const BuildOptions options{.voxelSize = 0.02f, .sign = Sign::flood};
    const Tiling tiling(bounds(mesh), options, {3, 1, 1});
    std::vector<FloodBorder> borders;
    for (std::size_t tile = 0; tile < 3; ++tile) borders.push_back(emptyBorder(tiling.own(tile)));
    const BlockBox middle = tiling.own(1);
    borders[0].open = {0};
    borders[1] = {middle, {0, 0}, {}, {}, false};
    const int last = middle.end.x - blockSide;
    borders[1].space = {{{middle.first.x, 0, 0}, 1, 0}, {{last, 0, 0}, 2, 1}};
    const auto sides = joinRegions(tiling, [&](std::size_t tile) { return borders[tile]; });
    CHECK(sides[0] == RegionSides{1});
    CHECK(sides[1] == RegionSides{1, 0});
    CHECK(sides[2] == RegionSides{0});
    CHECK(borders[1].spaceAt({last, 0, 8}) == 1u);
    CHECK(!borders[1].spaceAt({last, 0, 16}));
    CHECK(!borders[1].spaceAt({last, 8, 0}));
    CHECK(!borders[1].leafAt({last, 0, 0}));
}

TEST_CASE("files of borders that are damaged are found") {
    const std::filesystem::path path = test::scratch("tile.by_distance");
    const BorderArrivals arrivals{7, {{{8, 16, 24}, 3, 511, 1}, {{0, 0, 0}, 9, 0, 0}}};
    writeArrivals(path, arrivals);
    CHECK(readArrivals(path).all == arrivals.all);
    CHECK(readRound(path) == 7);
    std::fstream(path, std::ios::binary | std::ios::in | std::ios::out).seekp(20).put('x');
    CHECK_THROWS_WITH(readArrivals(path), Contains("tile.by_distance: is damaged"));
    std::filesystem::resize_file(path, 5);
    CHECK_THROWS_WITH(readArrivals(path), Contains("is damaged"));
    HashedRecordWriter record;
    record.add(std::uint64_t(1) << 60);
    record.write(path);
    CHECK_THROWS_WITH(HashedRecordReader(path).values<int>(), Contains("is damaged"));
}
}  // namespace bilayer::tile_flood_signs_test
