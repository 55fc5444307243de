// SPDX-License-Identifier: Apache-2.0
#include "tools/tiles/planned_tiles.h"

#include <algorithm>
#include <utility>

#include "sdf/tiles/tile_build.h"
#include "sdf/tiles/tile_signs.h"

namespace bilayer::tools {

namespace {

// 82,000 tiles took 440 MB in all.
constexpr double bytesOfJoin = 90e6, bytesPerRecord = 4300;

}  // namespace

double PlannedTiles::need(std::size_t tile) const {
    return detail::tileBytes(load(tile).triangles, load(tile).area, tiling, tile, options);
}

double PlannedTiles::largestNeed() const {
    double largest = 0;
    for (std::size_t tile = 0; tile < size(); ++tile) largest = std::max(largest, need(tile));
    return largest;
}

double PlannedTiles::needOfRecords() const {
    return bytesOfJoin + double(size()) * bytesPerRecord;
}

PlannedTiles plannedTiles(TilePlan plan, BuildArguments arguments, const glm::ivec3& counts) {
    setSizes(arguments, plan.voxelSize());
    const BuildOptions options = optionsWith(arguments.options, plan.signs().signs);
    const detail::Tiling tiling(plan.facts().box, options, counts);
    return {std::move(plan), options, tiling};
}

}  // namespace bilayer::tools
