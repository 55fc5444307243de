// SPDX-License-Identifier: Apache-2.0
// The checks of the certificate pass what the exact method computes, and fail where any part of it is damaged.
#include "sdf/fill/certificate.h"

#include <catch2/catch.hpp>
#include <random>
#include <stdexcept>

#include "demos/shared/shapes.h"
#include "sdf/fill/block_bins.h"
#include "sdf/fill/clusters.h"
#include "tests/support/support.h"

namespace bilayer::certificate_test {
using namespace bilayer::detail;

namespace {

constexpr double voxelsPerUnit = 10;
constexpr float reach = 4;

// The exact method's data for one brick of a torus.
struct Brick {
    Mesh mesh = shapes::torus(1, 0.4f, 40, 20);
    TriangleBins bins = binTriangles(mesh, bounds(mesh), voxelsPerUnit, reach);
    std::size_t number = bins.count() / 2;
    std::vector<Piece> pieces;
    Clusters clusters;
    BlockBins reaching;

    Brick() {
        PieceCutter cutter(16, pieces);
        const glm::dvec3 first(origin());
        const double margin = double(reach) + 1;
        const TriangleLimits limits{first - margin, first + double(bins.side - 1) + margin};
        forEachTriangle(
            mesh, bins.trianglesOf(number), voxelsPerUnit,
            [&](std::uint32_t triangle, const TriangleCorners& corners) { cutter.cut(corners, triangle, limits); });
        cutter.finish();
        clusters.build(pieces, origin());
        reaching.build(clusters.clusters(), blocksAlong(), reach);
    }

    glm::ivec3 origin() const { return bins.origins[number]; }
    int blocksAlong() const { return bins.side / blockSide; }

    // A block with voxels within and beyond reach, and its origin.
    std::pair<glm::ivec3, BlockDistances> someBlock() {
        std::size_t at = 0;
        BlockDistances block;
        for (int x = 0; x < blocksAlong(); ++x)
            for (int y = 0; y < blocksAlong(); ++y)
                for (int z = 0; z < blocksAlong(); ++z, ++at) {
                    const glm::ivec3 inBrick = blockSide * glm::ivec3(x, y, z);
                    if (measureBlock({reaching.at(at), clusters.clusters().data(), clusters.members().data(),
                                      pieces.data(), origin() + inBrick, glm::vec3(inBrick), reach},
                                     block) &&
                        voxelWhere(block, true) && voxelWhere(block, false))
                        return {origin() + inBrick, block};
                }
        throw std::logic_error("no such block");
    }

    // A voxel that has a nearest piece, or none; 0: there is no such voxel in addition to the first one.
    static int voxelWhere(const BlockDistances& block, bool known) {
        for (int voxel = 1; voxel < blockVoxels; ++voxel)
            if ((block.nearest[voxel] >= 0) == known) return voxel;
        return 0;
    }

    void check(const glm::ivec3& at, const BlockDistances& block) const {
        BlockCheck(mesh, bins.trianglesOf(number), voxelsPerUnit).require(at, pieces, block, reach);
    }
};

}  // namespace

TEST_CASE("the certificate of a torus holds") {
    Brick brick;
    const auto [at, block] = brick.someBlock();
    CHECK_NOTHROW(requireCompleteBins(brick.mesh, brick.bins, voxelsPerUnit, reach));
    CHECK_NOTHROW(requireCovered(brick.pieces, brick.clusters.clusters(), brick.clusters.members(), brick.origin()));
    CHECK_NOTHROW(brick.check(at, block));
}

TEST_CASE("a triangle that is missing in a brick breaks the certificate") {
    Brick brick;
    // the first triangle whose corner lies within the brick
    auto& offsets = brick.bins.offsets;
    for (std::size_t i = offsets[brick.number]; i < offsets[brick.number + 1]; ++i) {
        const glm::uvec3& t = brick.mesh.triangles[brick.bins.triangles[i]];
        const glm::dvec3 corner = glm::dvec3(brick.mesh.points[t.x]) * voxelsPerUnit - glm::dvec3(brick.origin());
        if (glm::min(corner.x, glm::min(corner.y, corner.z)) < 0 ||
            glm::max(corner.x, glm::max(corner.y, corner.z)) > double(brick.bins.side - 1))
            continue;
        brick.bins.triangles.erase(brick.bins.triangles.begin() + std::ptrdiff_t(i));
        for (std::size_t b = brick.number + 1; b < offsets.size(); ++b) --offsets[b];
        CHECK_THROWS_AS(requireCompleteBins(brick.mesh, brick.bins, voxelsPerUnit, reach), std::logic_error);
        return;
    }
    FAIL("no triangle lies within the brick");
}

TEST_CASE("a radius or a cylinder that is too small breaks the certificate") {
    Brick brick;
    const auto covered = [&](std::span<const Piece> pieces, std::span<const Cluster> clusters) {
        requireCovered(pieces, clusters, brick.clusters.members(), brick.origin());
    };
    std::vector<Piece> pieces = brick.pieces;
    pieces[pieces.size() / 2].radius *= 0.99f;
    CHECK_THROWS_AS(covered(pieces, brick.clusters.clusters()), std::logic_error);
    std::vector<Cluster> clusters(brick.clusters.clusters().begin(), brick.clusters.clusters().end());
    clusters[clusters.size() / 2].radius *= 0.9f;
    CHECK_THROWS_AS(covered(brick.pieces, clusters), std::logic_error);
}

TEST_CASE("a distance that is wrong by more than its bound breaks the certificate") {
    Brick brick;
    auto [at, block] = brick.someBlock();
    const int known = Brick::voxelWhere(block, true), unknown = Brick::voxelWhere(block, false);
    const float distance = block.distance[known];
    block.distance[known] = distance + 1e-3f;
    CHECK_THROWS_AS(brick.check(at, block), std::logic_error);
    block.distance[known] = std::max(0.f, distance - 1e-3f);
    CHECK_THROWS_AS(brick.check(at, block), std::logic_error);
    block.distance[known] = distance;
    CHECK_NOTHROW(brick.check(at, block));
    const std::int32_t nearest = block.nearest[known];
    block.nearest[known] = -1;  // as if it were beyond reach
    CHECK_THROWS_AS(brick.check(at, block), std::logic_error);
    block.nearest[known] = nearest;
    block.nearest[unknown] = nearest;  // as if that piece were within reach
    block.distance[unknown] = distance;
    CHECK_THROWS_AS(brick.check(at, block), std::logic_error);
}
}  // namespace bilayer::certificate_test
