// SPDX-License-Identifier: Apache-2.0
#include "tools/tiles/flood_run.h"

#include <malloc.h>

#include <algorithm>
#include <exception>
#include <memory>
#include <string>
#include <utility>

#include <bilayer/sdf/grids.h>
#include "sdf/grid/vdb_grids.h"
#include "sdf/io/content_hash.h"
#include "sdf/tiles/flood_regions.h"
#include "sdf/tiles/hashed_record.h"
#include "sdf/tiles/tile_sort.h"

namespace bilayer::tools {

using namespace bilayer::detail;

void FloodRun::prepare(const std::vector<std::size_t>& share) {
    const Stopwatch watch;
    if (ranks_.isFirst()) folder_.removeGrowth();
    for (const std::size_t tile : share)
        if (!isFilled(tile)) fill(tile);
    ranks_.wait();
    if (ranks_.isFirst()) join();
    ranks_.wait();
    readSides();
    grow(Growth::byDistance, share);
    grow(Growth::byTriangles, share);
    exchange_.seconds += watch.seconds();
}

// A killed run may have left a tile's files.
bool FloodRun::isFilled(std::size_t tile) const {
    if (tiles_.load(tile).triangles == 0) return true;
    const glm::ivec3 place = tiles_.tiling.place(tile);
    if (!std::filesystem::exists(folder_.border(place))) return false;
    try {
        std::string hash;
        const FloodBorder border = readBorder(folder_.border(place), &hash);
        return border.isEmpty || fileHash(folder_.distances(place)) == hash;
    } catch (const std::exception&) {
        return false;  // it is damaged
    }
}

// Writes the unsigned distances of a tile, then its border.
void FloodRun::fill(std::size_t tile) const {
    const glm::ivec3 place = tiles_.tiling.place(tile);
    const std::vector<TileTriangle> triangles = readTileTriangles(folder_.triangles(place), tiles_.load(tile));
    BuiltTile built =
        buildTile(triangles, tiles_.plan.facts(), tiles_.tiling, tile, tiles_.options, tiles_.plan.signs().signs);
    if (!built.grids) return writeBorder(folder_.border(place), emptyBorder(tiles_.tiling.own(tile)), "");
    openvdb::GridCPtrVec grids{withOrigin(built.grids->distance, tiles_.plan.facts().origin)};
    if (built.grids->triangle) grids.push_back(withOrigin(built.grids->triangle, tiles_.plan.facts().origin));
    writeGrids(folder_.distances(place), grids);
    grids.clear();
    const FloodTile flood(std::move(built.grids), tiles_.tiling, tile, tiles_.options);
    writeBorder(folder_.border(place), flood.border(), fileHash(folder_.distances(place)));
    ::malloc_trim(0);  // what one tile has used is free for the next
}

FloodBorder FloodRun::borderOf(std::size_t tile) const {
    if (tiles_.load(tile).triangles == 0) return emptyBorder(tiles_.tiling.own(tile));
    return readBorder(folder_.border(tiles_.tiling.place(tile)));
}

void FloodRun::join() const {
    HashedRecordWriter record;
    for (const RegionSides& sides : joinRegions(tiles_.tiling, [this](std::size_t tile) { return borderOf(tile); }))
        record.add(sides);
    record.write(folder_.regions());
}

void FloodRun::readSides() {
    HashedRecordReader record(folder_.regions());
    sides_.clear();
    for (std::size_t tile = 0; tile < tiles_.size(); ++tile) sides_.push_back(record.values<std::uint8_t>());
    exchange_.bytes += record.size();
}

// Repeats until no tile of any rank improves. A tile may read what its neighbours write in the same round: whatever
// the order, arrivals only become earlier, and end at the same steps.
void FloodRun::grow(Growth growth, const std::vector<std::size_t>& share) {
    const std::string name = growth == Growth::byDistance ? "by_distance" : "by_triangles";
    for (std::uint32_t round = 1;; ++round) {
        bool improved = false;
        for (const std::size_t tile : share)
            if (isDue(growth, tile, round) && improve(growth, tile, round)) improved = true;
        if (improved) writeText(folder_.improved(name, round), "");
        ranks_.wait();
        if (!std::filesystem::exists(folder_.improved(name, round))) return;
    }
}

// Returns whether a tile may improve: in the first round, and after a neighbour has.
bool FloodRun::isDue(Growth growth, std::size_t tile, std::uint32_t round) const {
    if (!hasLeaves(tile)) return false;
    if (round == 1) return true;
    const std::vector<std::size_t> neighbours = around(tile);
    return std::any_of(neighbours.begin(), neighbours.end(), [&](std::size_t other) {
        const std::filesystem::path file = fileOf(growth, other);
        return std::filesystem::exists(file) && readRound(file) + 1 >= round;
    });
}

bool FloodRun::improve(Growth growth, std::size_t tile, std::uint32_t round) {
    FloodTile flood = load(tile, growth == Growth::byTriangles);
    BorderArrivals arrivals{round, flood.growByDistance()};
    if (growth == Growth::byTriangles) arrivals.all = flood.growByTriangles(trianglesOf(tile));
    if (arrivals.all == arrivalsOf(growth, tile)) return false;
    writeArrivals(fileOf(growth, tile), arrivals);
    return true;
}

std::vector<BorderArrival> FloodRun::arrivalsOf(Growth growth, std::size_t tile) {
    const std::filesystem::path file = fileOf(growth, tile);
    if (!std::filesystem::exists(file)) return {};
    exchange_.bytes += std::filesystem::file_size(file);
    return readArrivals(file).all;
}

FloodTile FloodRun::load(std::size_t tile, bool withTriangles) {
    const std::shared_ptr<Grids> grids = readGrids(folder_.distances(tiles_.tiling.place(tile)));
    const auto transform = openvdb::math::Transform::createLinearTransform(double(tiles_.options.voxelSize));
    openvdb::ConstPtrCast<openvdb::FloatGrid>(grids->distance)->setTransform(transform);
    if (grids->triangle) openvdb::ConstPtrCast<openvdb::Int32Grid>(grids->triangle)->setTransform(transform);
    FloodTile flood(grids, tiles_.tiling, tile, tiles_.options);
    flood.setSides(sides_[tile]);
    for (const std::size_t other : around(tile)) {
        FloodNeighbour neighbour{borderOf(other), sides_[other]};
        neighbour.byDistance = arrivalsOf(Growth::byDistance, other);
        if (withTriangles) neighbour.byTriangles = arrivalsOf(Growth::byTriangles, other);
        const std::filesystem::path file = folder_.border(tiles_.tiling.place(other));
        if (std::filesystem::exists(file)) exchange_.bytes += std::filesystem::file_size(file);
        flood.add(neighbour);
    }
    return flood;
}

WindingNumber FloodRun::trianglesOf(std::size_t tile) const {
    return WindingNumber(meshOf(readTileTriangles(folder_.triangles(tiles_.tiling.place(tile)), tiles_.load(tile)),
                                tiles_.plan.facts().origin));
}

// The tiles that touch a tile, at its edges and corners too.
std::vector<std::size_t> FloodRun::around(std::size_t tile) const {
    std::vector<std::size_t> found;
    const glm::ivec3 place = tiles_.tiling.place(tile), lower = glm::max(place - 1, glm::ivec3(0)),
                     upper = glm::min(place + 1, tiles_.tiling.counts() - 1);
    for (int x = lower.x; x <= upper.x; ++x)
        for (int y = lower.y; y <= upper.y; ++y)
            for (int z = lower.z; z <= upper.z; ++z)
                if (const std::size_t other = tiles_.tiling.tileAt({x, y, z}); other != tile) found.push_back(other);
    return found;
}

std::filesystem::path FloodRun::fileOf(Growth growth, std::size_t tile) const {
    const glm::ivec3 place = tiles_.tiling.place(tile);
    return growth == Growth::byDistance ? folder_.byDistance(place) : folder_.byTriangles(place);
}

bool FloodRun::hasLeaves(std::size_t tile) const {
    return tiles_.load(tile).triangles > 0 && std::filesystem::exists(folder_.distances(tiles_.tiling.place(tile)));
}

BuiltTile FloodRun::build(std::size_t tile) {
    if (!hasLeaves(tile)) {
        BuiltTile built;
        built.inside = sides_[tile].at(0) != 0;
        return built;
    }
    FloodTile flood = load(tile, true);
    flood.growByDistance();
    flood.growByTriangles(trianglesOf(tile));
    return flood.signedTile();
}

FloodRun::Exchange FloodRun::takeExchange() {
    return std::exchange(exchange_, {});
}

}  // namespace bilayer::tools
