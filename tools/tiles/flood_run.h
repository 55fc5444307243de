// SPDX-License-Identifier: Apache-2.0
// The steps of a build in tiles whose signs are by flood. Ranks exchange the borders of tiles through files.
// Tested by tests/tools/tile_floods.cpp through the program.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

#include "sdf/base/stopwatch.h"
#include "sdf/tiles/flood_border.h"
#include "sdf/tiles/flood_tile.h"
#include "tools/tiles/planned_tiles.h"
#include "tools/tiles/ranks.h"
#include "tools/tiles/tile_folder.h"

namespace bilayer::tools {

class FloodRun {
  public:
    /// All arguments must outlive this.
    FloodRun(const TileFolder& folder, const PlannedTiles& tiles, const Ranks& ranks)
        : folder_(folder), tiles_(tiles), ranks_(ranks) {}

    /// Finds the sides of all voxels on borders, with all other ranks.
    /// @param share  of all tiles, for this rank
    void prepare(const std::vector<std::size_t>& share);

    /// Builds a tile.
    detail::BuiltTile build(std::size_t tile);

    /// What other tiles have cost.
    struct Exchange {
        std::uint64_t bytes = 0;  ///< read of them
        double seconds = 0;       ///< in prepare()
    };
    /// Returns what has been added since the last call.
    Exchange takeExchange();

  private:
    enum class Growth { byDistance, byTriangles };

    void fill(std::size_t tile) const;
    bool isFilled(std::size_t tile) const;
    void join() const;
    void readSides();
    void grow(Growth growth, const std::vector<std::size_t>& share);
    bool isDue(Growth growth, std::size_t tile, std::uint32_t round) const;
    bool improve(Growth growth, std::size_t tile, std::uint32_t round);
    std::vector<detail::BorderArrival> arrivalsOf(Growth growth, std::size_t tile);
    detail::FloodBorder borderOf(std::size_t tile) const;
    detail::FloodTile load(std::size_t tile, bool withTriangles);
    detail::WindingNumber trianglesOf(std::size_t tile) const;
    std::vector<std::size_t> around(std::size_t tile) const;
    std::filesystem::path fileOf(Growth growth, std::size_t tile) const;
    bool hasLeaves(std::size_t tile) const;

    const TileFolder& folder_;
    const PlannedTiles& tiles_;
    const Ranks& ranks_;
    std::vector<detail::RegionSides> sides_;  // of all tiles
    Exchange exchange_;
};

}  // namespace bilayer::tools
