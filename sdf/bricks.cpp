#include "sdf/bricks.h"

#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vector_relational.hpp>
#include <utility>

#include "sdf/blocks.h"

namespace bilayer {
namespace {

constexpr std::size_t tilesPerRun = 8192;        // what one task bins
constexpr std::size_t countersAtMost = 1 << 24;  // over all runs: 64 MiB
constexpr int blocksPerBrick = brickBlocks * brickBlocks * brickBlocks;
constexpr int blocksWorthCulling = 8;  // a tile over more blocks than this is tested against each block

struct Box {
    glm::ivec3 lower, upper;  // both included
};

// Rounds down; many times quicker than glm::floor without SSE 4.1.
glm::ivec3 floorToInt(const glm::vec3& v) {
    const glm::ivec3 cut(v);
    return cut - glm::ivec3(glm::lessThan(v, glm::vec3(cut)));
}

// The voxels that lie within `reach` of a tile's samples, axis by axis.
Box voxelsOf(const Tile& tile, float reach) {
    glm::vec3 lower = tile.first, upper = tile.first;
    if (tile.rows > 1) {
        const float last = float(tile.rows - 1);
        const glm::vec3 left = tile.first + last * tile.down, right = left + last * tile.across;
        lower = glm::min(lower, glm::min(left, right));
        upper = glm::max(upper, glm::max(left, right));
    }
    return {tile.base - floorToInt(reach - lower), tile.base + floorToInt(upper + reach)};
}

// Rounds down to whole cells of 2^shift voxels, for negative coordinates too.
Box cellsOf(const Box& voxels, int shift) {
    const auto cell = [&](const glm::ivec3& v) { return glm::ivec3(v.x >> shift, v.y >> shift, v.z >> shift); };
    return {cell(voxels.lower), cell(voxels.upper)};
}

constexpr int brickShift = 6, blockShift = 3;
static_assert(1 << brickShift == brickSide && 1 << blockShift == blockSide);

template <class Visit>
void forEachCell(const Box& cells, Visit visit) {
    for (int x = cells.lower.x; x <= cells.upper.x; ++x)
        for (int y = cells.lower.y; y <= cells.upper.y; ++y)
            for (int z = cells.lower.z; z <= cells.upper.z; ++z) visit(glm::ivec3(x, y, z));
}

// Whether the plane of a tile passes a block at a distance that no sample can bridge.
bool planeMisses(const Tile& tile, const glm::vec3& normal, const glm::ivec3& block, float reach) {
    constexpr float half = 0.5f * (blockSide - 1);
    const glm::vec3 centre = glm::vec3(block * blockSide - tile.base) + half;
    const float spread = half * (std::abs(normal.x) + std::abs(normal.y) + std::abs(normal.z));
    // cubes of the paper's neighbourhood stick out of the ball by this factor at most
    return std::abs(glm::dot(normal, centre - tile.first)) > reach * std::sqrt(3.f) + spread;
}

}  // namespace

Bricks binBricks(const Tiles& tiles, float reach) {
    Bricks bricks;
    bricks.offsets.push_back(0);
    if (tiles.tiles.empty()) return bricks;
    const int margin = int(std::ceil(reach)) + 1;
    const Box range = cellsOf({tiles.lower - margin, tiles.upper + margin}, brickShift);
    const glm::ivec3 size = range.upper - range.lower + 1;
    const std::size_t cells = std::size_t(size.x) * std::size_t(size.y) * std::size_t(size.z);
    const auto cellIndex = [&](const glm::ivec3& brick) {
        const glm::ivec3 at = brick - range.lower;
        return (std::size_t(at.x) * std::size_t(size.y) + std::size_t(at.y)) * std::size_t(size.z) + std::size_t(at.z);
    };

    // a counting sort, stable whatever the number of runs: count in each run, sum up, scatter
    const std::size_t count = tiles.tiles.size();
    const std::size_t runs =
        std::clamp<std::size_t>(countersAtMost / cells, 1, (count + tilesPerRun - 1) / tilesPerRun);
    const auto forEachTile = [&](std::size_t run, auto visit) {
        for (std::size_t i = count * run / runs; i < count * (run + 1) / runs; ++i)
            forEachCell(cellsOf(voxelsOf(tiles.tiles[i], reach), brickShift),
                        [&](const glm::ivec3& brick) { visit(cellIndex(brick), std::uint32_t(i)); });
    };
    std::vector<std::uint64_t> cursors(runs * cells, 0);
    tbb::parallel_for(std::size_t(0), runs, [&](std::size_t run) {
        forEachTile(run, [&](std::size_t cell, std::uint32_t) { ++cursors[run * cells + cell]; });
    });
    std::uint64_t sum = 0;
    for (std::size_t cell = 0; cell < cells; ++cell) {
        const std::uint64_t begin = sum;
        for (std::size_t run = 0; run < runs; ++run) sum += std::exchange(cursors[run * cells + cell], sum);
        if (sum == begin) continue;
        const int z = int(cell % std::size_t(size.z)), y = int(cell / std::size_t(size.z) % std::size_t(size.y)),
                  x = int(cell / std::size_t(size.z) / std::size_t(size.y));
        bricks.origins.push_back((range.lower + glm::ivec3(x, y, z)) * brickSide);
        bricks.offsets.push_back(sum);
    }
    bricks.tiles.resize(sum);
    tbb::parallel_for(std::size_t(0), runs, [&](std::size_t run) {
        forEachTile(run,
                    [&](std::size_t cell, std::uint32_t tile) { bricks.tiles[cursors[run * cells + cell]++] = tile; });
    });
    return bricks;
}

void binBlocks(const Tiles& tiles, const Bricks& bricks, std::size_t brick, float reach, BrickBlocks& blocks) {
    blocks.pairs.clear();
    std::array<std::uint32_t, blocksPerBrick> cursors{};
    const glm::ivec3 first = bricks.origins[brick] / blockSide;
    for (const std::uint32_t index : bricks.tilesOf(brick)) {
        const Tile& tile = tiles.tiles[index];
        Box cells = cellsOf(voxelsOf(tile, reach), blockShift);
        cells.lower = glm::max(cells.lower, first);
        cells.upper = glm::min(cells.upper, first + (brickBlocks - 1));
        const glm::ivec3 size = cells.upper - cells.lower + 1;
        const bool large = size.x * size.y * size.z > blocksWorthCulling;
        const glm::vec3 normal = large ? glm::normalize(tile.offset) : glm::vec3(0);
        forEachCell(cells, [&](const glm::ivec3& block) {
            if (large && planeMisses(tile, normal, block, reach)) return;
            const glm::ivec3 at = block - first;
            const auto cell = std::uint32_t((at.x * brickBlocks + at.y) * brickBlocks + at.z);
            ++cursors[cell];
            blocks.pairs.push_back({cell, index});
        });
    }
    blocks.origins.clear();
    blocks.offsets.assign(1, 0);
    std::uint32_t sum = 0;
    for (int cell = 0; cell < blocksPerBrick; ++cell) {
        const std::uint32_t count = std::exchange(cursors[std::size_t(cell)], sum);
        if (count == 0) continue;
        sum += count;
        const glm::ivec3 at(cell / (brickBlocks * brickBlocks), cell / brickBlocks % brickBlocks, cell % brickBlocks);
        blocks.origins.push_back((first + at) * blockSide);
        blocks.offsets.push_back(sum);
    }
    blocks.tiles.resize(sum);
    for (const auto& pair : blocks.pairs) blocks.tiles[cursors[pair.block]++] = pair.tile;
}

}  // namespace bilayer
