// SPDX-License-Identifier: Apache-2.0
#include "sdf/grid/tile_flood.h"

#include <openvdb/tools/SignedFloodFill.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <random>

#include "tests/support/support.h"

namespace bilayer::tile_flood_test {
using namespace bilayer::detail;

namespace {

using LargeNode = openvdb::FloatTree::RootNodeType::ChildNodeType;
using SmallNode = LargeNode::ChildNodeType;
constexpr float outside = 3, inside = -2;

// A tree of leaves in random places around the origin, each on one side or with a random sign in its first and last
// voxel.
openvdb::FloatTree randomLeaves(std::mt19937& random, int count, int reach) {
    openvdb::FloatTree tree(outside);
    std::uniform_int_distribution<int> place(-reach, reach - 1), side(0, 1);
    for (int i = 0; i < count; ++i) {
        auto* leaf = tree.touchLeaf(openvdb::Coord(place(random), place(random), place(random)));
        leaf->fill(side(random) ? inside : outside);
        leaf->setValueOnly(0, side(random) ? inside : outside);
        leaf->setValueOnly(openvdb::FloatTree::LeafNodeType::NUM_VALUES - 1, side(random) ? inside : outside);
    }
    return tree;
}

}  // namespace

TEST_CASE("tiles between leaves get the signs that OpenVDB's flood fill gives them") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    std::mt19937 random(seed);
    for (const int reach : {60, 300, 5000})
        for (int round = 0; round < 10; ++round) {
            openvdb::FloatTree tree = randomLeaves(random, 1 + int(random() % 40), reach), expected(tree);
            openvdb::tools::signedFloodFillWithValues(expected, outside, inside, false, 1, 1);
            std::size_t set = 0;
            for (auto large = tree.root().beginChildOn(); large; ++large) {
                for (auto small = large->beginChildOn(); small; ++small)
                    floodTiles(*small, inside, [&](openvdb::Index) { ++set; });
                floodTiles(*large, inside, [&](openvdb::Index) { ++set; });
            }
            openvdb::tools::SignedFloodFillOp<openvdb::FloatTree>(outside, inside)(tree.root());
            std::size_t insideTiles = 0;
            for (auto value = expected.cbeginValueOff(); value; ++value) {
                REQUIRE(tree.getValue(value.getCoord()) == *value);
                insideTiles += !value.isVoxelValue() && *value < 0 && value.getDepth() > 0;
            }
            CHECK(set == insideTiles);
            CHECK(tree.hasSameTopology(expected));
        }
}
}  // namespace bilayer::tile_flood_test
