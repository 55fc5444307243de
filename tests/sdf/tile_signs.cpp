// SPDX-License-Identifier: Apache-2.0
// Signs of tiles by winding numbers, and the automatic choice: leaf by leaf, the bytes of fields in one piece.
#include "sdf/tiles/tile_signs.h"

#include <bilayer/sdf/build.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <glm/gtc/quaternion.hpp>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include <bilayer/sdf/grids.h>
#include "demos/shared/shapes.h"
#include "sdf/base/openvdb.h"
#include "sdf/tiles/hashed_record.h"
#include "sdf/tiles/tile_columns.h"
#include "sdf/tiles/tile_merge.h"
#include "tests/sdf/union_solids.h"
#include "tests/support/same_fields.h"
#include "tests/support/support.h"

namespace bilayer::tile_signs_test {
using namespace bilayer::detail;
using bilayer::test::sameFields;
using Catch::Contains;

namespace {

// A field in tiles, as its ranks build it, but in memory.
class TiledBuild {
  public:
    TiledBuild(const Mesh& mesh, const BuildOptions& options, const glm::ivec3& counts, int round = 0)
        : options_(options), mesh_(decideSigns(mesh, options, round, [] {})), tiling_(bounds(mesh), options, counts) {
        const double voxelsPerUnit = 1.0 / double(options.voxelSize);
        triangles_.resize(tiling_.size());
        mesh_.source->forEach([&](std::span<const TileTriangle> batch) {
            for (const TileTriangle& t : batch) {
                const auto at = [&](int k) { return glm::dvec3(t.corners[k]) * voxelsPerUnit; };
                tiling_.forEachTileOf({at(0), at(1), at(2)}, [&](std::size_t tile) { triangles_[tile].push_back(t); });
            }
        });
        for (std::size_t tile = 0; tile < tiling_.size(); ++tile)
            sums_.push_back(crossingsOf(triangles_[tile], tiling_, tile, options.voxelSize));
    }

    const PartSigns& signs() const { return mesh_.signs; }
    const Tiling& tiling() const { return tiling_; }
    const ColumnSums& sums(std::size_t tile) const { return sums_[tile]; }

    BuiltTile build(std::size_t tile, const PartSigns& signs) const {
        PartSigns own = signs;
        const ColumnSums below = crossingsBelow(tiling_, tile, [&](std::size_t other) { return sums_[other]; });
        own.below = &below;
        return buildTile(triangles_[tile], mesh_.source->facts(), tiling_, tile, options_, own);
    }

    // Nothing if the normals contradict each other.
    std::optional<LevelSet> merged(const PartSigns& signs, SignCounts& sum) const {
        std::vector<BuiltTile> built;
        std::vector<SignCounts> counts;
        for (std::size_t tile = 0; tile < tiling_.size(); ++tile) {
            built.push_back(build(tile, signs));
            counts.push_back(built.back().counts);
        }
        sum = sumOf(counts);
        if (judge(sum) == SignVerdict::conflict) return std::nullopt;
        TileMerger merger;
        for (const BuiltTile& tile : built)
            if (tile.grids) merger.add(*tile.grids);
        return merger.merged();
    }

  private:
    BuildOptions options_;
    SignedSource mesh_;
    Tiling tiling_;
    std::vector<std::vector<TileTriangle>> triangles_;
    std::vector<ColumnSums> sums_;
};

// Builds tiles until their counts show that the signs are right.
LevelSet inTiles(const Mesh& mesh, const BuildOptions& options, const glm::ivec3& counts) {
    for (int round = 0;; ++round) {
        const TiledBuild tiles(mesh, options, counts, round);
        SignCounts sum;
        const std::optional<LevelSet> field = tiles.merged(tiles.signs(), sum);
        if (judge(sum) == SignVerdict::right) return *field;
        SignCounts none;
        if (judge(sum) == SignVerdict::wrong) return *tiles.merged(corrected(tiles.signs(), sum), none);
        REQUIRE(round < 3);
    }
}

// @param counts  of tiles, or as many as there is room for
void checkSame(const Mesh& mesh, const BuildOptions& options, glm::ivec3 counts) {
    const Tiling one(bounds(mesh), options, {1, 1, 1});
    counts = glm::min(counts, (one.lattice().end - one.lattice().first) / one.brickSide());
    const LevelSet whole = build(mesh, options);
    CAPTURE(counts.x, counts.y, counts.z, options.voxelSize, whole.sign(), whole.signReason());
    const LevelSet tiled = inTiles(mesh, options, counts);  // may refuse
    CHECK(sameFields(tiled, whole));
}

glm::quat anyRotation(std::mt19937& random) {
    std::normal_distribution<float> normal;
    return glm::normalize(glm::quat(normal(random), normal(random), normal(random), normal(random)));
}

// Closed solids that may overlap, lie in each other, or be inside out.
Mesh randomSolids(std::mt19937& random, bool mayBeFlipped) {
    std::uniform_real_distribution<float> place(-0.8f, 0.8f), size(0.1f, 0.7f);
    std::vector<Mesh> parts;
    for (int i = 1 + int(random() % 5); i > 0; --i) {
        Mesh part = random() % 2 ? shapes::sphere(size(random), 3)
                                 : shapes::box({size(random), size(random), 0.2f * size(random)});
        const glm::quat rotation = anyRotation(random);
        for (glm::vec3& p : part.points) p = rotation * p;
        if (mayBeFlipped && random() % 4 == 0) part = shapes::flipped(std::move(part));
        parts.push_back(shapes::moved(std::move(part), {place(random), place(random), place(random)}));
    }
    return shapes::join(parts);
}

const glm::ivec3 tilings[] = {{1, 1, 1}, {2, 2, 2}, {3, 1, 2}, {1, 1, 4}};

}  // namespace

TEST_CASE("tiles of closed meshes have the bytes of winding numbers of the whole mesh") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    for (int round = 0; round < 12; ++round) {
        const Mesh mesh = randomSolids(random, true);
        BuildOptions options{.voxelSize = voxelSizeFor(mesh, 120), .sign = Sign::winding};
        if (round % 3 == 1) options.triangles = true;
        if (round % 3 == 2) {
            options.exteriorWidthVoxels = 4.5f;
            options.interiorWidthVoxels = random() % 2 ? 1.5f : 0.6f;
        }
        checkSame(mesh, options, tilings[round % 4]);
    }
}

TEST_CASE("boxes with faces, edges and corners in voxels have the same signs in tiles") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    for (int round = 0; round < 12; ++round) {
        const Mesh mesh = test::joined(test::randomBoxes(random, 1 + int(random() % 6)));
        for (const Sign sign : {Sign::winding, Sign::automatic}) {
            const BuildOptions options{.voxelSize = 1.f / 64, .sign = sign};
            try {
                checkSame(mesh, options, tilings[round % 4]);
            } catch (const std::invalid_argument& refusal) {
                CHECK_THAT(refusal.what(), Contains("cancel out"));
                CHECK(sign == Sign::automatic);
            }
        }
    }
}

TEST_CASE("tiles choose the signs of the whole mesh") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    std::size_t built = 0;
    for (int round = 0; round < 16; ++round) {
        CAPTURE(round);
        Mesh mesh = randomSolids(random, false);
        if (round % 4 == 3)  // triangles that orienting the mesh flips
            for (int i = 0; i < 3; ++i) {
                glm::uvec3& t = mesh.triangles[random() % mesh.triangles.size()];
                std::swap(t.x, t.y);
            }
        BuildOptions options{.voxelSize = voxelSizeFor(mesh, 120)};
        if (round % 5 == 4) options.exteriorWidthVoxels = 0.7f;
        try {
            checkSame(mesh, options, tilings[round % 4]);
            ++built;
        } catch (const std::invalid_argument& refusal) {
            CHECK_THAT(refusal.what(), Contains("cancel out") || Contains("the sign auto is"));
        }
    }
    CHECK(built >= 8);
}

TEST_CASE("an inside-out sphere is built in tiles") {
    checkSame(shapes::flipped(shapes::sphere(1, 4)), {.voxelSize = 0.02f}, {2, 2, 2});
}

// The normals between two walls within a voxel of each other are wrong, without a conflict.
TEST_CASE("tiles correct the signs of thin bars that cross") {
    Mesh first = shapes::box({20, 1, 1});
    for (glm::vec3& p : first.points) p = glm::angleAxis(0.01f, glm::vec3(0, 0, 1)) * p;
    const Mesh flat = shapes::join({first, shapes::moved(shapes::box({1, 20, 1}), {0, 0.05f, 0.025f})});
    Mesh upright = flat;
    for (glm::vec3& p : upright.points) p = {p.z, p.x, p.y};
    std::size_t corrected = 0;
    for (const float resolution : {5.f, 10.f, 20.f, 25.f, 30.f, 40.f, 80.f})
        for (const float width : {3.f, 0.8f}) {
            const BuildOptions options{.voxelSize = voxelSizeFor(flat, resolution), .interiorWidthVoxels = width};
            corrected += build(flat, options).signReason().find("voxels have the side of their winding number") !=
                         std::string::npos;
            checkSame(flat, options, {1, 1, 1});
            checkSame(flat, options, {2, 1, 1});
            checkSame(upright, options, {1, 2, 1});
            checkSame(upright, options, {1, 1, 2});
            checkSame(upright, options, {1, 2, 2});
        }
    CHECK(corrected > 0);
}

TEST_CASE("every crossing of a column counts in one tile") {
    const Mesh mesh = shapes::join({shapes::torusKnot(2, 3, 1, 0.2f), shapes::box({0.9f, 0.8f, 0.3f})});
    const BuildOptions options{.voxelSize = voxelSizeFor(mesh, 150), .sign = Sign::winding};
    const TiledBuild one(mesh, options, {1, 1, 1}), many(mesh, options, {3, 2, 2});
    for (const std::int32_t sum : one.sums(0).values()) CHECK(sum == 0);
    std::size_t nonzero = 0;
    for (std::size_t tile = 0; tile < many.tiling().size(); tile += 2) {
        const ColumnSums &lower = many.sums(tile), &upper = many.sums(tile + 1);
        for (std::size_t i = 0; i < lower.values().size(); ++i) {
            CHECK(lower.values()[i] + upper.values()[i] == 0);
            nonzero += lower.values()[i] != 0;
        }
    }
    CHECK(nonzero > 1000);
}

TEST_CASE("files of column sums") {
    const std::filesystem::path path = test::scratch("tile.sums");
    ColumnSums sums({-5, 2}, {40, 30});
    sums.add(-2, 7, 3);
    sums.add(11, 9, -1);
    writeColumnSums(path, sums);
    // the box, the count, the sums without the zeros around them, the hash
    CHECK(std::filesystem::file_size(path) == 16 + 8 + 14 * 3 * 4 + 8);
    ColumnSums read({-5, 2}, {40, 30});
    read.add(readColumnSums(path));
    CHECK(read.values() == sums.values());
    writeColumnSums(path, ColumnSums({0, 0}, {9, 9}));
    CHECK(readColumnSums(path).values().empty());
    for (const std::size_t bytes : {0u, 15u, 20u}) {
        std::ofstream(path, std::ios::binary) << std::string(bytes, '\x01');
        CHECK_THROWS_WITH(readColumnSums(path), Contains("tile.sums"));
    }
    // more and fewer sums than the box has columns, and no box
    for (const auto& [end, count] : {std::pair(glm::ivec2(3, 2), 7), {glm::ivec2(3, 2), 5}, {glm::ivec2(-1, -6), 6}}) {
        HashedRecordWriter record;
        record.add(glm::ivec2(0, 0));
        record.add(end);
        record.add(std::vector<std::int32_t>(std::size_t(count), 1));
        record.write(path);
        CHECK_THROWS_WITH(readColumnSums(path), Contains("tile.sums: is damaged"));
    }
    std::filesystem::remove(path);
    CHECK_THROWS_WITH(readColumnSums(path), Contains("tile.sums"));
}

TEST_CASE("signs that only the whole mesh can give are refused by name") {
    const auto refused = [](const Mesh& mesh, Sign sign, const char* why) {
        CHECK_THROWS_WITH(decideSigns(mesh, {.voxelSize = 0.05f, .sign = sign}, 0, [] {}), Contains(why));
    };
    Mesh open = shapes::sphere(1, 3);
    open.triangles.pop_back();
    refused(open, Sign::winding, "tiles have winding numbers of closed and oriented meshes only");
    refused(open, Sign::automatic, "the sign auto is winding here, because of 3 boundary edges");
    CHECK(decideSigns(open, {.voxelSize = 0.05f, .sign = Sign::normals}, 0, [] {}).signs.method == Sign::normals);

    // what is not read whole is not oriented
    const auto streamed = [](const Mesh& mesh, int round) {
        return decideSigns(trianglesOf(mesh), {.voxelSize = 0.05f}, round);
    };
    CHECK(streamed(shapes::sphere(1, 3), 0).signs.reason == closedAndOriented);
    CHECK_THROWS_WITH(streamed(shapes::sphere(1, 3), 1), Contains("allow more memory, or take another sign"));
    CHECK_THROWS_WITH(streamed(open, 0), Contains("edges are not used equally often"));
}

TEST_CASE("counts of tiles are judged as those of the whole field") {
    const auto verdict = [](std::size_t leaves, SignRepair fifth, SignRepair all, std::size_t conflicts = 0) {
        return judge({conflicts, {leaves, fifth, all}});
    };
    CHECK(verdict(1000, {}, {}) == SignVerdict::right);
    CHECK(verdict(1000, {}, {}, 1) == SignVerdict::conflict);
    CHECK(verdict(1000, {}, {2, 0}) == SignVerdict::wrong);
    CHECK(verdict(2000, {}, {2, 0}) == SignVerdict::right);  // no column of those that are compared first
    CHECK(verdict(2000, {1, 0}, {2, 0}) == SignVerdict::wrong);
    CHECK(verdict(2000, {1, 0}, {2, 1}) == SignVerdict::conflict);
}
}  // namespace bilayer::tile_signs_test
