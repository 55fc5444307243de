// SPDX-License-Identifier: Apache-2.0
// Builds tiles of a plan, and writes their files and records.
// Tested by tests/tools/tiles.cpp through the program.
#pragma once

#include <cstddef>
#include <filesystem>
#include <vector>

#include "collider/field/layout/surface_file.h"
#include "sdf/tiles/tile_build.h"
#include "tools/tiles/column_files.h"
#include "tools/tiles/flood_run.h"
#include "tools/tiles/planned_tiles.h"
#include "tools/tiles/ranks.h"
#include "tools/tiles/tile_folder.h"

namespace bilayer::tools {

class TileBuilder {
  public:
    /// All arguments must outlive this.
    /// @param mesh  the file, for errors
    TileBuilder(const std::filesystem::path& mesh, const TileFolder& folder, const PlannedTiles& tiles,
                const Ranks& ranks)
        : mesh_(mesh),
          folder_(folder),
          tiles_(tiles),
          ranks_(ranks),
          sums_(folder, tiles),
          flood_(folder, tiles, ranks) {}

    /// Exchanges with all other ranks what the signs of tiles need.
    /// @param missing  tiles that this rank is to build
    /// @param all      of all tiles, this rank's share
    void prepare(const std::vector<std::size_t>& missing, const std::vector<std::size_t>& all);

    /// Builds a tile, and writes its files, then its record.
    void build(std::size_t tile);

  private:
    void writeSums(const std::vector<std::size_t>& missing);
    detail::BuiltTile built(std::size_t tile);
    void write(detail::BuiltTile tile, std::size_t number, Json& record) const;
    std::vector<detail::SurfaceBlock> surfaceBlocksOf(detail::BuiltTile tile, const detail::BlockBox& own) const;

    const std::filesystem::path& mesh_;
    const TileFolder& folder_;
    const PlannedTiles& tiles_;
    const Ranks& ranks_;
    ColumnFiles sums_;
    FloodRun flood_;
};

}  // namespace bilayer::tools
