#include "sdf/bricks.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <map>
#include <set>
#include <tuple>

#include "demos/shared/shapes.h"
#include "sdf/blocks.h"

using namespace bilayer;

namespace {

using Key = std::tuple<int, int, int>;

// Blocks that hold a voxel within `reach` of a sample of the tile, by looking at every voxel around every sample.
std::set<Key> reached(const Tile& tile, float reach) {
    std::set<Key> blocks;
    const int r = int(std::ceil(reach));
    for (int i = 0; i < tile.rows; ++i)
        for (int j = 0; j <= i; ++j) {
            const glm::vec3 p = tile.first + float(i) * tile.down + float(j) * tile.across;
            const glm::ivec3 c(glm::floor(p));
            for (int x = c.x - r; x <= c.x + r + 1; ++x)
                for (int y = c.y - r; y <= c.y + r + 1; ++y)
                    for (int z = c.z - r; z <= c.z + r + 1; ++z) {
                        const glm::vec3 d = glm::vec3(x, y, z) - p;
                        if (d.x * d.x + d.y * d.y + d.z * d.z >= reach * reach) continue;
                        const glm::ivec3 v = tile.base + glm::ivec3(x, y, z);
                        blocks.insert({v.x >> 3, v.y >> 3, v.z >> 3});
                    }
        }
    return blocks;
}

}  // namespace

TEST_CASE("every block that a sample reaches has its tile, each once and in order") {
    const Mesh mesh = shapes::join({shapes::sphere(7.3f, 2), shapes::box({40, 3, 3}), shapes::torus(20, 4, 40, 20)});
    for (const float reach : {1.5f, 4.f, 11.f}) {
        CAPTURE(reach);
        const Tiles tiles = makeTiles(mesh, {.voxelSize = 0.5f});
        const Bricks bricks = binBricks(tiles, reach);
        std::map<Key, std::vector<std::uint32_t>> binned;
        BrickBlocks blocks;
        for (std::size_t brick = 0; brick < bricks.count(); ++brick) {
            const auto of = bricks.tilesOf(brick);
            CHECK(!of.empty());
            CHECK(std::is_sorted(of.begin(), of.end(), std::less_equal<>()));
            binBlocks(tiles, bricks, brick, reach, blocks);
            for (std::size_t b = 0; b < blocks.origins.size(); ++b) {
                const glm::ivec3 o = blocks.origins[b];
                auto& list = binned[{o.x >> 3, o.y >> 3, o.z >> 3}];
                REQUIRE(list.empty());
                list.assign(blocks.tiles.begin() + blocks.offsets[b], blocks.tiles.begin() + blocks.offsets[b + 1]);
                CHECK(std::is_sorted(list.begin(), list.end(), std::less_equal<>()));
            }
        }
        std::size_t missing = 0, needed = 0, kept = 0;
        for (const auto& entry : binned) kept += entry.second.size();
        for (std::uint32_t tile = 0; tile < tiles.tiles.size(); ++tile)
            for (const Key& key : reached(tiles.tiles[tile], reach)) {
                ++needed;
                const auto found = binned.find(key);
                missing +=
                    found == binned.end() || !std::binary_search(found->second.begin(), found->second.end(), tile);
            }
        CHECK(missing == 0);
        CHECK(kept < 3 * needed);  // and not far more than needed
    }
}

TEST_CASE("no tile gives no brick") {
    const Bricks bricks = binBricks(Tiles{}, 3.f);
    CHECK(bricks.count() == 0);
}
