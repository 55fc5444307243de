// SPDX-License-Identifier: Apache-2.0
#include "sdf/leaf/sign_propagation.h"

#include <catch2/catch.hpp>
#include <random>
#include <vector>

#include "tests/support/support.h"

namespace bilayer::sign_propagation_test {
using namespace bilayer::detail;

namespace {

using Random = std::mt19937;

glm::ivec3 placeOf(int voxel) {
    return {voxel / 64, voxel / 8 % 8, voxel % 8};
}

bool has(const BlockMask& mask, int voxel) {
    return (mask[std::size_t(voxel / 64)] >> (voxel % 64)) & 1;
}

void put(BlockMask& mask, int voxel) {
    mask[std::size_t(voxel / 64)] |= std::uint64_t(1) << (voxel % 64);
}

// Distances of all magnitudes, plus one extra row, which must not matter.
std::vector<float> anyDistances(Random& random) {
    std::uniform_real_distribution<float> scale(0.3f, 1.2f), part(0, 1);
    const float largest = scale(random);
    std::vector<float> distances(blockVoxels + blockSide, farAway);
    for (std::size_t i = 0; i < std::size_t(blockVoxels); ++i)
        distances[i] = random() % 16 == 0 ? farAway : largest * part(random);
    return distances;
}

// Visits the pairs of neighbours (voxel, next voxel, axis).
template <class Visit>
void forEachPair(Visit visit) {
    const int steps[] = {64, 8, 1};
    for (int voxel = 0; voxel < blockVoxels; ++voxel)
        for (int axis = 0; axis < 3; ++axis)
            if (placeOf(voxel)[axis] < blockSide - 1) visit(voxel, voxel + steps[axis], axis);
}

// A group number for each voxel, equal for all voxels that links connect.
std::vector<int> groupsOf(const std::vector<float>& distances) {
    std::vector<int> group(blockVoxels);
    for (int voxel = 0; voxel < blockVoxels; ++voxel) group[std::size_t(voxel)] = voxel;
    for (bool more = true; more;) {
        more = false;
        forEachPair([&](int a, int b, int) {
            if (!(distances[std::size_t(a)] + distances[std::size_t(b)] > 1 + linkSlack)) return;
            int &x = group[std::size_t(a)], &y = group[std::size_t(b)];
            more = more || x != y;
            x = y = std::min(x, y);
        });
    }
    return group;
}

}  // namespace

TEST_CASE("links: neighbours are linked if their distances together exceed a voxel") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    for (int round = 0; round < 20; ++round) {
        const std::vector<float> distances = anyDistances(random);
        const SignLinks links = findSignLinks(distances.data());
        const BlockMask* const along[] = {&links.x, &links.y, &links.z};
        std::size_t wrong = 0, linked = 0, bits = 0;
        forEachPair([&](int a, int b, int axis) {
            const bool expected = distances[std::size_t(a)] + distances[std::size_t(b)] > 1.f + linkSlack;
            wrong += has(*along[axis], a) != expected;
            linked += expected;
        });
        for (const BlockMask* mask : along)
            for (const std::uint64_t word : *mask) bits += std::size_t(std::popcount(word));
        CHECK(wrong == 0);
        CHECK(bits == linked);  // none leaves the block
    }
}

TEST_CASE("links: a sign propagates to the whole group, and one voxel is queried for each group without one") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    std::size_t onBothEver = 0, asked = 0;
    for (int round = 0; round < 50; ++round) {
        const std::vector<float> distances = anyDistances(random);
        const std::vector<int> group = groupsOf(distances);
        BlockSides sides{};
        BlockMask first{}, all{};
        std::vector<bool> out(blockVoxels), in(blockVoxels), preferred(blockVoxels), met(blockVoxels);
        for (int voxel = 0; voxel < blockVoxels; ++voxel) {
            const auto g = std::size_t(group[std::size_t(voxel)]);
            put(all, voxel);
            if (random() % 40 == 0) put(random() % 3 ? sides.outside : sides.inside, voxel);
            if (has(sides.outside, voxel)) out[g] = true;
            if (has(sides.inside, voxel)) in[g] = true;
            if (random() % 4) continue;
            put(first, voxel);
            preferred[g] = true;
        }
        std::size_t expected = 0;
        for (const int g : group) expected += out[std::size_t(g)] && in[std::size_t(g)];
        const auto answer = [](int g) { return g % 3 == 0; };
        const auto isInside = [&](int voxel) {
            const auto g = std::size_t(group[std::size_t(voxel)]);
            CHECK_FALSE((out[g] || in[g] || met[g]));
            CHECK((has(first, voxel) || !preferred[g]));
            met[g] = true;
            ++asked;
            return answer(int(g));
        };
        const std::size_t onBoth = completeSides(findSignLinks(distances.data()), {&first, &all}, sides, isInside);
        CHECK(onBoth == expected);
        onBothEver += onBoth;
        std::size_t wrong = 0;
        for (int voxel = 0; voxel < blockVoxels; ++voxel) {
            const int g = group[std::size_t(voxel)];
            const bool open = !out[std::size_t(g)] && !in[std::size_t(g)];
            wrong += has(sides.outside, voxel) != (open ? !answer(g) : out[std::size_t(g)]);
            wrong += has(sides.inside, voxel) != (open ? answer(g) : in[std::size_t(g)]);
        }
        CHECK(wrong == 0);
    }
    CHECK(onBothEver > 0);
    CHECK(asked > 0);
}
}  // namespace bilayer::sign_propagation_test
