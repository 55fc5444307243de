// SPDX-License-Identifier: Apache-2.0
#include <bilayer/sdf/build.h>
#include <bilayer/sdf/mesh_io.h>
#include <bilayer/sdf/vdb_io.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <numeric>
#include <random>

#include <bilayer/sdf/grids.h>
#include "demos/shared/shapes.h"
#include "sdf/base/openvdb.h"
#include "tests/support/same_fields.h"
#include "tests/support/support.h"

namespace bilayer::rebuild_test {
using bilayer::test::sameFields;

namespace {

std::vector<std::uint32_t> trianglesThatMoved(const Mesh& before, const Mesh& after) {
    std::vector<std::uint32_t> moved;
    for (std::uint32_t i = 0; i < before.triangles.size(); ++i)
        for (int k = 0; k < 3; ++k)
            if (before.points[before.triangles[i][k]] != after.points[after.triangles[i][k]]) {
                moved.push_back(i);
                break;
            }
    return moved;
}

// Displaces points within a radius of a centre, fading with distance.
Mesh dented(Mesh mesh, const glm::vec3& centre, float radius, const glm::vec3& pull) {
    for (auto& point : mesh.points) {
        const float part = glm::distance(point, centre) / radius;
        if (part < 1) point += (1 - part * part) * pull;
    }
    return mesh;
}

void checkFrame(const Mesh& before, const Mesh& after, const BuildOptions& options) {
    const LevelSet old = build(before, options), full = build(after, options);
    const auto moved = trianglesThatMoved(before, after);
    CAPTURE(moved.size(), before.triangles.size());
    CHECK(sameFields(rebuild(old, before, after, moved, options), full));
}

// Counts leaves that only one of the grids has, or that have different values.
std::size_t changedLeaves(const openvdb::FloatGrid& a, const openvdb::FloatGrid& b) {
    std::size_t changed = 0;
    for (auto leaf = a.tree().cbeginLeaf(); leaf; ++leaf) {
        const auto* other = b.tree().probeConstLeaf(leaf->origin());
        changed += !other || std::memcmp(leaf->buffer().data(), other->buffer().data(), 512 * sizeof(float)) != 0;
    }
    for (auto leaf = b.tree().cbeginLeaf(); leaf; ++leaf) changed += !a.tree().probeConstLeaf(leaf->origin());
    return changed;
}

// A knot with a tube thick enough that dents do not cause self-intersection.
Mesh knot() {
    return shapes::torusKnot(2, 3, 1, 0.2f);
}

}  // namespace

TEST_CASE("a field rebuilt from the one before is the one built in full") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> uniform(-1, 1);
    std::vector<Mesh> meshes{knot(), shapes::sphere(1, 5), shapes::box({1, 0.7f, 0.4f})};
    if (const auto bunny = test::corpusMesh("bunny_watertight.obj")) meshes.push_back(readMesh(*bunny));
    for (const Mesh& rest : meshes) {
        const float side = bounds(rest).longestSide();
        Mesh before = rest;
        BuildOptions options{.voxelSize = side / 60};
        LevelSet field = build(before, options);
        for (int frame = 0; frame < 4; ++frame) {
            const glm::vec3 centre = before.points[random() % before.points.size()];
            const glm::vec3 pull(uniform(random), uniform(random), uniform(random));
            const Mesh after = dented(before, centre, 0.2f * side, 0.03f * side * pull);
            const auto moved = trianglesThatMoved(before, after);
            CAPTURE(frame, moved.size(), before.triangles.size());
            // each frame is built from the last, so that errors accumulate
            field = rebuild(field, before, after, moved, options);
            CHECK(sameFields(field, build(after, options)));
            before = after;
        }
    }
}

TEST_CASE("rebuilding keeps the nearest triangles, asymmetric bands and other ways of building") {
    const Mesh before = knot();
    const glm::vec3 centre = before.points[before.points.size() / 3];
    const Mesh after = dented(before, centre, 0.3f, {0.04f, 0.03f, -0.05f});
    const float h = voxelSizeFor(before, 70);
    checkFrame(before, after, {.voxelSize = h, .triangles = true});
    checkFrame(before, after, {.voxelSize = h, .exteriorWidthVoxels = 6.5f, .interiorWidthVoxels = 1.5f});
    checkFrame(before, after, {.voxelSize = h, .sign = Sign::normals, .threads = 1});
    checkFrame(before, after, {.voxelSize = h, .exteriorWidthVoxels = 0.4f, .interiorWidthVoxels = 1});
    checkFrame(before, after, {.voxelSize = h, .sign = Sign::winding});
    checkFrame(before, after, {.voxelSize = h, .method = Method::pseudonormal});
    checkFrame(before, after, {.voxelSize = h, .method = Method::doubleLayer});
}

TEST_CASE("nothing may move, or all, or far away and back") {
    const Mesh still = knot();
    const BuildOptions options{.voxelSize = voxelSizeFor(still, 60), .triangles = true};
    checkFrame(still, still, options);
    checkFrame(still, shapes::moved(still, {0.3f, 5, -0.1f}), options);

    // a ball leaves the band, so that its voxels must vanish, and returns; another ball inside a hollow one flips its
    // tiles
    const Mesh ball = shapes::sphere(0.3f, 3);
    const auto scene = [&](const glm::vec3& at) { return shapes::join({still, shapes::moved(ball, at)}); };
    checkFrame(scene({3, 0, 0}), scene({12, 7, -40}), options);
    checkFrame(scene({12, 7, -40}), scene({3, 0, 0}), options);
    const auto grown = [&](float radius) {
        return shapes::join({still, transformed(ball, glm::scale(glm::mat4(1), glm::vec3(radius)))});
    };
    checkFrame(grown(0.1f), grown(1.2f), {.voxelSize = 0.02f});
    checkFrame(grown(1.2f), grown(0.1f), {.voxelSize = 0.02f});
}

TEST_CASE("a mesh that turns inside out or into itself is built as in full") {
    const Mesh ball = shapes::sphere(1, 4);
    const auto pair = [&](float apart) { return shapes::join({ball, shapes::moved(ball, {apart, 0, 0})}); };
    checkFrame(pair(3), pair(1.5f), {.voxelSize = 0.05f});
    checkFrame(pair(1.5f), pair(3), {.voxelSize = 0.05f});
    Mesh torn = pair(3);
    torn.points[0] += glm::vec3(0.01f, 0.02f, 0);
    checkFrame(pair(3), torn, {.voxelSize = 0.05f});
    Mesh open = pair(3);
    open.triangles[7] = {open.triangles[7].x, open.triangles[7].x, open.triangles[7].y};
    const BuildOptions options{.voxelSize = 0.05f};
    const std::uint32_t moved[] = {7};
    CHECK(sameFields(rebuild(build(pair(3), options), pair(3), open, moved, options), build(open, options)));
}

TEST_CASE("a rebuild fills the blocks around what moved and copies the others") {
    // 70,200 triangles, of which one in a hundred moves
    const Mesh before = shapes::torus(1, 0.3f, 270, 130);
    const Mesh after = dented(before, before.points[before.points.size() / 3], 0.16f, {0.01f, 0.02f, 0.03f});
    const auto moved = trianglesThatMoved(before, after);
    const double share = double(moved.size()) / double(before.triangles.size());
    CAPTURE(share);
    REQUIRE((share > 0.005 && share < 0.02));
    const BuildOptions options{.voxelSize = voxelSizeFor(before, 128)};
    const LevelSet old = build(before, options), expected = build(after, options);
    const LevelSet updated = rebuild(old, before, after, moved, options);
    CHECK(sameFields(updated, expected));
    const BuildTimes &full = expected.buildTimes(), &part = updated.buildTimes();
    const std::size_t changed = changedLeaves(*old.grids().distance, *expected.grids().distance);
    CAPTURE(full.filledBlocks, part.filledBlocks, changed);
    CHECK(full.filledBlocks >= expected.leaves());
    CHECK(part.filledBlocks >= changed);
    CHECK(changed > 10);
    CHECK(part.filledBlocks < full.filledBlocks / 10);
    // nothing is filled if nothing moved
    const LevelSet same = rebuild(old, before, before, {}, options);
    CHECK(sameFields(same, old));
    CHECK(same.buildTimes().filledBlocks == 0);
}

TEST_CASE("a rebuild is a build in full where old blocks cannot be copied") {
    const Mesh before = knot();
    const Mesh after = dented(before, before.points[before.points.size() / 3], 0.2f, {0.04f, 0.03f, -0.05f});
    const auto moved = trianglesThatMoved(before, after);
    const auto filledInFull = [&](const LevelSet& old, const BuildOptions& options) {
        const LevelSet expected = build(after, options), updated = rebuild(old, before, after, moved, options);
        CHECK(sameFields(updated, expected));
        return updated.buildTimes().filledBlocks == expected.buildTimes().filledBlocks;
    };
    const float h = 1.f / 32;  // these widths are exact in 16 bits
    const BuildOptions plain{.voxelSize = h};
    CHECK_FALSE(filledInFull(build(before, plain), plain));
    for (const BuildOptions& options : {BuildOptions{.voxelSize = h, .sign = Sign::winding},
                                        BuildOptions{.voxelSize = h, .method = Method::pseudonormal},
                                        BuildOptions{.voxelSize = h, .method = Method::doubleLayer},
                                        BuildOptions{.voxelSize = h, .interiorWidthVoxels = 0.9f}})
        CHECK(filledInFull(build(before, options), options));

    // rounded to 16 bits in a file
    const auto path = test::scratch("rounded.vdb");
    writeVdb(path, build(before, plain), {.halfFloat = true});
    CHECK(filledInFull(readVdb(path), plain));
    // swept, as by fluid::extend(): the error bound is unknown, and other voxels are active
    auto swept = std::make_shared<Grids>();
    const auto grid = build(before, plain).grids().distance->deepCopy();
    grid->removeMeta(metadata::errorBound);
    for (auto leaf = grid->tree().beginLeaf(); leaf; ++leaf) leaf->setValuesOn();
    swept->distance = grid;
    CHECK(filledInFull(LevelSet(swept), plain));
}

TEST_CASE("a rebuild refuses what does not belong together, by name") {
    const Mesh before = knot();
    Mesh after = before;
    after.points[before.triangles[42].y] += glm::vec3(0.01f);
    const auto moved = trianglesThatMoved(before, after);
    const BuildOptions options{.voxelSize = 0.05f};
    const LevelSet old = build(before, options);
    const auto refused = [&](const Mesh& from, const Mesh& to, std::vector<std::uint32_t> which, BuildOptions asked,
                             const std::string& words) {
        CHECK_THROWS_AS(rebuild(old, from, to, which, asked), std::invalid_argument);
        CHECK_THROWS_WITH(rebuild(old, from, to, which, asked), Catch::Contains(words));
    };
    auto fewer = moved;
    const std::uint32_t first = fewer[1];
    fewer.erase(fewer.begin() + 1);
    refused(before, after, fewer, options, "moved lacks triangle " + std::to_string(first) + ",");
    refused(before, after, {std::uint32_t(before.triangles.size())}, options, "there are only");
    Mesh shorter = after;
    shorter.triangles.pop_back();
    refused(before, shorter, moved, options, "triangles and now has");
    refused(after, after, {}, options, "another mesh");
    refused(before, after, moved, {.voxelSize = 0.06f}, "voxels of");
    refused(before, after, moved, {.voxelSize = 0.05f, .exteriorWidthVoxels = 4}, "band");
    refused(before, after, moved, {.voxelSize = 0.05f, .method = Method::pseudonormal}, "method");
    refused(before, after, moved, {.voxelSize = 0.05f, .triangles = true}, "nearest triangles");
    refused(before, after, moved, {.voxelSize = 0}, "voxelSize");
}
}  // namespace bilayer::rebuild_test
