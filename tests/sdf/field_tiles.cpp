// SPDX-License-Identifier: Apache-2.0
// Fields that are built tile by tile: leaf by leaf, the bytes of fields that are built in one piece.
#include <bilayer/sdf/build.h>
#include <bilayer/sdf/mesh_io.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <random>
#include <string>
#include <vector>

#include <bilayer/sdf/grids.h>
#include "demos/shared/shapes.h"
#include "sdf/base/openvdb.h"
#include "sdf/grid/field_part.h"
#include "sdf/tiles/tile_build.h"
#include "sdf/tiles/tile_merge.h"
#include "sdf/tiles/tiling.h"
#include "tests/support/same_fields.h"
#include "tests/support/support.h"

namespace bilayer::field_tiles_test {
using namespace bilayer::detail;
using bilayer::test::sameFields;
using Catch::Contains;

namespace {

BuildOptions local(BuildOptions options) {
    if (options.method == Method::exact) options.sign = Sign::normals;
    return options;
}

std::vector<std::vector<TileTriangle>> trianglesOfTiles(const Mesh& mesh, Tiling& tiling, float voxelSize) {
    std::vector<std::vector<TileTriangle>> tiles(tiling.size());
    const double voxelsPerUnit = 1.0 / double(voxelSize);
    for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i) {
        const glm::uvec3& t = mesh.triangles[i];
        const TileTriangle triangle{i, {mesh.points[t.x], mesh.points[t.y], mesh.points[t.z]}};
        const auto at = [&](int k) { return glm::dvec3(triangle.corners[k]) * voxelsPerUnit; };
        tiling.forEachTileOf({at(0), at(1), at(2)}, [&](std::size_t tile) { tiles[tile].push_back(triangle); });
    }
    return tiles;
}

// Counts blocks of a box whose values, active voxels or space differ from the whole field's.
std::size_t differentBlocks(const openvdb::FloatGrid& tile, const openvdb::FloatGrid& whole, const BlockBox& box) {
    std::size_t different = 0;
    float value = 0;
    bool active = false;
    for (int x = box.first.x; x < box.end.x; x += blockSide)
        for (int y = box.first.y; y < box.end.y; y += blockSide)
            for (int z = box.first.z; z < box.end.z; z += blockSide) {
                const openvdb::Coord block(x, y, z);
                const auto *a = tile.tree().probeConstLeaf(block), *b = whole.tree().probeConstLeaf(block);
                if (a && b)
                    different += a->getValueMask() != b->getValueMask() ||
                                 std::memcmp(a->buffer().data(), b->buffer().data(), 512 * sizeof(float)) != 0;
                else if (a)
                    different += !a->isConstant(value, active) || active || value != whole.tree().getValue(block);
                else
                    different += b || tile.tree().getValue(block) != whole.tree().getValue(block);
            }
    return different;
}

void checkTiles(const Mesh& mesh, const BuildOptions& options, const glm::ivec3& counts) {
    CAPTURE(counts.x, counts.y, counts.z, options.voxelSize);
    const LevelSet whole = build(mesh, options);
    Tiling tiling(bounds(mesh), options, counts);
    const auto triangles = trianglesOfTiles(mesh, tiling, options.voxelSize);
    const MeshFacts facts{bounds(mesh), mesh.origin, hash(mesh), mesh.triangles.size()};
    TileMerger merger;
    std::uint64_t leaves = 0;
    for (std::size_t i = 0; i < tiling.size(); ++i) {
        CAPTURE(i);
        const BuiltTile tile = buildTile(triangles[i], facts, tiling, i, options);
        const BlockBox own = tiling.own(i).within(tiling.lattice());
        if (!tile.grids) {
            // empty: all of it is on one side
            auto empty = openvdb::FloatGrid::create(
                whole.grids().distance->tree().getValue({own.first.x, own.first.y, own.first.z}));
            CHECK(differentBlocks(*empty, *whole.grids().distance, own) == 0);
            continue;
        }
        CHECK(differentBlocks(*tile.grids->distance, *whole.grids().distance, own) == 0);
        for (auto leaf = tile.grids->distance->tree().cbeginLeaf(); leaf; ++leaf) {
            CHECK(own.contains({leaf->origin().x(), leaf->origin().y(), leaf->origin().z()}));
            ++leaves;
        }
        merger.add(*tile.grids);
    }
    CHECK(leaves >= whole.leaves());
    CHECK(sameFields(merger.merged(), whole));
}

}  // namespace

TEST_CASE("tiles have the bytes of the whole field, for any tiling") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    std::vector<Mesh> meshes{shapes::torusKnot(2, 3, 1, 0.2f), shapes::sphere(1, 5), shapes::box({1, 0.7f, 0.4f})};
    if (const auto bunny = test::corpusMesh("bunny_watertight.obj")) meshes.push_back(readMesh(*bunny));
    for (const Mesh& mesh : meshes) {
        const float h = voxelSizeFor(mesh, 150);
        for (int i = 0; i < 2; ++i) {
            const glm::ivec3 counts(1 + random() % 4, 1 + random() % 3, 1 + random() % 3);
            checkTiles(mesh, local({.voxelSize = h}), counts);
        }
    }
}

TEST_CASE("tiles keep nearest triangles, bands of all widths, and the double layer method") {
    const Mesh mesh = shapes::torusKnot(2, 3, 1, 0.2f);
    const float h = voxelSizeFor(mesh, 140);
    const glm::ivec3 counts(3, 2, 2);
    checkTiles(mesh, local({.voxelSize = h, .triangles = true}), counts);
    checkTiles(mesh, local({.voxelSize = h, .exteriorWidthVoxels = 6.5f, .interiorWidthVoxels = 1.5f}), counts);
    checkTiles(mesh, local({.voxelSize = h, .exteriorWidthVoxels = 0.4f, .interiorWidthVoxels = 1}), counts);
    checkTiles(mesh, {.voxelSize = h, .method = Method::doubleLayer}, counts);
    checkTiles(mesh, {.voxelSize = h, .method = Method::doubleLayer, .triangles = true}, {4, 1, 2});
}

TEST_CASE("the space of a solid that fills whole tiles is inside") {
    // tiles within the box of 400 voxels a side hold no triangle
    const Mesh mesh = shapes::box({1, 1, 1});
    checkTiles(mesh, local({.voxelSize = voxelSizeFor(mesh, 260)}), {5, 5, 5});
}

TEST_CASE("tiles far from zero keep the mesh's origin") {
    Mesh mesh = shapes::sphere(1, 4);
    mesh.origin = {1e6, -2e5, 3};
    checkTiles(mesh, local({.voxelSize = voxelSizeFor(mesh, 100)}), {2, 2, 1});
}

TEST_CASE("a tile holds no triangle that it does not need") {
    const Mesh mesh = shapes::sphere(1, 6);
    const BuildOptions options = local({.voxelSize = voxelSizeFor(mesh, 400)});
    Tiling tiling(bounds(mesh), options, {4, 4, 4});
    const auto triangles = trianglesOfTiles(mesh, tiling, options.voxelSize);
    const double margin = 3 + tiling.brickSide();  // the band, and the brick that its triangles are in
    std::size_t total = 0;
    for (std::size_t i = 0; i < tiling.size(); ++i) {
        const BlockBox own = tiling.own(i);
        total += triangles[i].size();
        for (const TileTriangle& t : triangles[i]) {
            glm::dvec3 low(1e30), high(-1e30);
            for (const glm::vec3& corner : t.corners) {
                low = glm::min(low, glm::dvec3(corner) / double(options.voxelSize));
                high = glm::max(high, glm::dvec3(corner) / double(options.voxelSize));
            }
            CHECK(glm::all(glm::lessThan(low, glm::dvec3(own.end) + margin)));
            CHECK(glm::all(glm::greaterThan(high, glm::dvec3(own.first) - margin)));
        }
    }
    CHECK(double(total) < 1.5 * double(mesh.triangles.size()));
}

TEST_CASE("what only the whole mesh can decide is refused by name") {
    const Mesh mesh = shapes::sphere(1, 4);
    const float h = voxelSizeFor(mesh, 100);
    const auto refused = [](const BuildOptions& options, const std::string& name) {
        CHECK_THROWS_WITH(requireLocal(options), Contains(name));
    };
    refused({.voxelSize = h, .method = Method::pseudonormal, .sign = Sign::normals}, "no method pseudonormal");
    refused({.voxelSize = h, .method = Method::prism}, "no method prism");
    refused({.voxelSize = h, .sign = Sign::normals, .unite = true}, "no union");
    CHECK_THROWS_WITH(Tiling(bounds(mesh), local({.voxelSize = h}), {1, 9, 1}),
                      Contains("9 tiles along y: the field has room for 1 to"));

    // an inside-out sphere: a field in one piece flips it
    Mesh flipped = mesh;
    for (glm::uvec3& t : flipped.triangles) std::swap(t.y, t.z);
    const BuildOptions options = local({.voxelSize = h});
    for (const glm::ivec3 counts : {glm::ivec3(1), glm::ivec3(2)}) {
        Tiling tiling(bounds(flipped), options, counts);
        const auto triangles = trianglesOfTiles(flipped, tiling, h);
        CHECK_THROWS_WITH(buildTile(triangles[0], {bounds(flipped)}, tiling, 0, options),
                          Contains("build this field in one piece"));
    }
}

TEST_CASE("only tiles of one field are merged") {
    const Mesh mesh = shapes::sphere(1, 4);
    const auto tile = [&](float voxels, float width) {
        const BuildOptions options = local({.voxelSize = voxelSizeFor(mesh, voxels), .exteriorWidthVoxels = width});
        Tiling tiling(bounds(mesh), options, {2, 1, 1});
        const auto triangles = trianglesOfTiles(mesh, tiling, options.voxelSize);
        return buildTile(triangles[0], {bounds(mesh), {}, hash(mesh)}, tiling, 0, options);
    };
    TileMerger merger;
    CHECK_THROWS_WITH(TileMerger().merged(), Contains("no tile has a voxel"));
    merger.add(*tile(80, 3).grids);
    CHECK_THROWS_WITH(merger.add(*tile(90, 3).grids), Contains("of different fields"));
    CHECK_THROWS_WITH(merger.add(*tile(80, 4).grids), Contains("band widths differ"));
    // half of a sphere is open where the other half is missing
    CHECK_THROWS_WITH(merger.merged(), Contains("contradict each other"));
}
}  // namespace bilayer::field_tiles_test
