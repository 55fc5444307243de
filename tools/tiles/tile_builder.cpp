// SPDX-License-Identifier: Apache-2.0
#include "tools/tiles/tile_builder.h"

#include <fmt/format.h>
#include <malloc.h>

#include <optional>
#include <stdexcept>
#include <utility>

#include <bilayer/sdf/grids.h>
#include "collider/field/layout/block_summary.h"
#include "sdf/base/stopwatch.h"
#include "sdf/grid/vdb_grids.h"
#include "sdf/io/content_hash.h"
#include "sdf/tiles/tile_sort.h"

namespace bilayer::tools {

using namespace bilayer::detail;
namespace {

template <class Work>
void withMeshInErrors(const std::filesystem::path& mesh, const Work& work) {
    try {
        work();
    } catch (const std::invalid_argument& error) {
        throw std::invalid_argument(fmt::format("{}: {}", mesh.string(), error.what()));
    }
}

}  // namespace

void TileBuilder::prepare(const std::vector<std::size_t>& missing, const std::vector<std::size_t>& all) {
    if (tiles_.plan.signs().needSums()) writeSums(missing);
    if (tiles_.plan.signs().areByFlood()) withMeshInErrors(mesh_, [&] { flood_.prepare(all); });
}

/// Writes the sums of tiles that are missing, and of those that are finished, whose sums may be missing too.
void TileBuilder::writeSums(const std::vector<std::size_t>& missing) {
    const auto write = [&](std::size_t tile) { withMeshInErrors(mesh_, [&] { sums_.write(tile); }); };
    for (const std::size_t tile : missing) write(tile);
    for (std::size_t tile = std::size_t(ranks_.rank); tile < tiles_.size(); tile += std::size_t(ranks_.count))
        if (std::filesystem::exists(folder_.record(tiles_.tiling.place(tile)))) write(tile);
    ranks_.wait();
}

BuiltTile TileBuilder::built(std::size_t tile) {
    BuiltTile built;
    if (tiles_.load(tile).triangles == 0) return built;
    PartSigns signs = tiles_.plan.signs().signs;
    std::optional<ColumnSums> below;
    if (tiles_.plan.signs().needSums()) signs.below = &below.emplace(sums_.below(tile));
    const std::vector<TileTriangle> triangles =
        readTileTriangles(folder_.triangles(tiles_.tiling.place(tile)), tiles_.load(tile));
    withMeshInErrors(
        mesh_, [&] { built = buildTile(triangles, tiles_.plan.facts(), tiles_.tiling, tile, tiles_.options, signs); });
    return built;
}

void TileBuilder::build(std::size_t tile) {
    const Stopwatch watch;
    const glm::ivec3 place = tiles_.tiling.place(tile);
    const std::uint64_t count = tiles_.load(tile).triangles, sumsBefore = sums_.readBytes();
    const bool isByFlood = tiles_.plan.signs().areByFlood();
    BuiltTile built = isByFlood ? flood_.build(tile) : this->built(tile);
    const FloodRun::Exchange exchange = flood_.takeExchange();
    Json record = recordOf(place, tiles_.tiling.own(tile).within(tiles_.tiling.lattice()), count, built);
    record["readBytes"] = count * sizeof(TileTriangle);
    record["sumBytes"] = sums_.readBytes() - sumsBefore + exchange.bytes;
    if (isByFlood && !built.grids) record["side"] = built.inside ? "inside" : "outside";
    if (built.grids) write(std::move(built), tile, record);
    built = {};
    ::malloc_trim(0);  // what one tile has used is free for the next
    record["rank"] = ranks_.rank;
    record["seconds"] = watch.seconds() + exchange.seconds;
    record["peakRssBytes"] = peakMemory();
    writeRecord(folder_.record(place), record);
}

void TileBuilder::write(BuiltTile tile, std::size_t number, Json& record) const {
    const glm::ivec3 place = tiles_.tiling.place(number);
    const glm::dvec3& origin = tiles_.plan.facts().origin;
    const std::filesystem::path field = folder_.field(place), cells = folder_.cells(place);
    openvdb::GridCPtrVec grids{withOrigin(tile.grids->distance, origin)};
    if (tile.grids->triangle) grids.push_back(withOrigin(tile.grids->triangle, origin));
    grids.push_back(withOrigin(tile.border, origin));
    writeGrids(field, grids);
    grids.clear();
    writeSurfaceBlocks(cells, surfaceBlocksOf(std::move(tile), tiles_.tiling.own(number)));
    record["file"] = field.filename().string();
    record["hash"] = fileHash(field);
    record["cells"] = cells.filename().string();
    record["cellsHash"] = fileHash(cells);
    record["writtenBytes"] = std::filesystem::file_size(field) + std::filesystem::file_size(cells);
}

std::vector<SurfaceBlock> TileBuilder::surfaceBlocksOf(BuiltTile tile, const BlockBox& own) const {
    const auto coord = [](const glm::ivec3& v) { return openvdb::Coord(v.x, v.y, v.z); };
    const auto grid = openvdb::ConstPtrCast<openvdb::FloatGrid>(tile.grids->distance);
    addBorder(grid->tree(), tile.border->tree());
    return surfaceBlocks(grid->tree(), {coord(own.first), coord(own.end - 1)}, tiles_.options.voxelSize);
}

}  // namespace bilayer::tools
