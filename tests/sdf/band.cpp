// SPDX-License-Identifier: Apache-2.0
#include "sdf/leaf/band.h"

#include <bitset>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "sdf/sign/octree_cells.h"
#include "tests/support/support.h"

namespace bilayer::band_test {
using namespace bilayer::detail;

namespace {

constexpr float unknown = std::numeric_limits<float>::infinity();

std::size_t at(int x, int y, int z) {
    return std::size_t((x * 8 + y) * 8 + z);
}

}  // namespace

TEST_CASE("a block is trimmed to the band, exclusive of its widths") {
    std::vector<float> distances(blockVoxels, 7.f), values(blockVoxels);
    distances[at(1, 2, 3)] = 2.999f;
    distances[at(1, 2, 4)] = 3.f;
    distances[at(1, 2, 5)] = -1.999f;
    distances[at(1, 2, 6)] = -2.f;
    distances[at(1, 2, 7)] = -0.f;
    BandMasks masks{};
    REQUIRE(trimToBand(distances.data(), {3, 2, 0.5f}, values.data(), masks));
    CHECK(values[at(1, 2, 3)] == 2.999f * 0.5f);
    CHECK(values[at(1, 2, 4)] == 1.5f);
    CHECK(values[at(1, 2, 5)] == -1.999f * 0.5f);
    CHECK(values[at(1, 2, 6)] == -1.f);
    CHECK(values[at(0, 0, 0)] == 1.5f);
    std::size_t count = 0;
    for (int x = 0; x < 8; ++x) count += std::bitset<64>(masks.active[std::size_t(x)]).count();
    CHECK(count == 3);
    CHECK(((masks.active[1] >> (2 * 8 + 3)) & 1) == 1);
    CHECK(((masks.active[1] >> (2 * 8 + 7)) & 1) == 1);
}

TEST_CASE("a block has the same band if its signs come later, up to the last bit of a distance") {
    const unsigned seed = bilayer::test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> size(0.001f, 2), width(0.6f, 6), beyond(-2 * bandEdge, bandEdge);
    std::vector<float> distances(blockVoxels), values(blockVoxels);
    for (int round = 0; round < 200; ++round) {
        const BandWidths widths{width(random), width(random), size(random)};
        BandMasks masks{}, wide{};
        for (float& d : distances)
            d = random() % 2 ? widths.exterior + beyond(random) : -widths.interior - beyond(random);
        REQUIRE(trimToBand(distances.data(), widths, values.data(), masks));

        BandLeaf leaf(openvdb::Coord(0));
        std::vector<float> unsignedDistances = distances;
        for (float& d : unsignedDistances) d = std::abs(d);
        REQUIRE(trimToBand(unsignedDistances.data(), {8, 8, widths.voxelSize}, leaf.buffer().data(), wide));
        signLeaf(leaf, masks.inside, widths);
        for (unsigned i = 0; i < unsigned(blockVoxels); ++i) {
            CHECK(leaf.isValueOn(i) == bilayer::detail::test(masks.active, i));
            CHECK(leaf.getValue(i) == values[i]);
        }
    }
}

TEST_CASE("unknown voxels take the sign that they are connected with") {
    // a wall of known voxels at x = 3 (inside) and x = 4 (outside) divides the leaf
    std::vector<float> distances(blockVoxels, unknown), values(blockVoxels);
    for (int y = 0; y < 8; ++y)
        for (int z = 0; z < 8; ++z) {
            distances[at(3, y, z)] = -0.5f;
            distances[at(4, y, z)] = 0.5f;
        }
    BandMasks masks{};
    REQUIRE(trimToBand(distances.data(), {1, 1, 1}, values.data(), masks));
    for (int x = 0; x < 8; ++x)
        for (int y = 0; y < 8; ++y)
            for (int z = 0; z < 8; ++z) {
                CHECK((values[at(x, y, z)] < 0) == (x <= 3));
                CHECK(std::abs(values[at(x, y, z)]) == (x == 3 || x == 4 ? 0.5f : 1.f));
            }
}

TEST_CASE("known voxels beyond a narrow band sign the background") {
    // widths of 0.25 voxels: nothing is active between -0.4 and 0.6, yet the signs differ
    std::vector<float> distances(blockVoxels), values(blockVoxels);
    for (int x = 0; x < 8; ++x)
        for (int y = 0; y < 8; ++y)
            for (int z = 0; z < 8; ++z) distances[at(x, y, z)] = float(z) - 3.4f;
    BandMasks masks{};
    REQUIRE(trimToBand(distances.data(), {0.25f, 0.25f, 1}, values.data(), masks));
    for (int z = 0; z < 8; ++z) CHECK(values[at(2, 2, z)] == (z < 4 ? -0.25f : 0.25f));
}

TEST_CASE("a block of which nothing is known is left alone") {
    std::vector<float> distances(blockVoxels, unknown), values(blockVoxels, 42.f);
    BandMasks masks{};
    CHECK_FALSE(trimToBand(distances.data(), {3, 3, 1}, values.data(), masks));
    CHECK(values[5] == 42.f);
}
}  // namespace bilayer::band_test
