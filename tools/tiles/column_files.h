// SPDX-License-Identifier: Apache-2.0
// The files of column sums, by which tiles know the winding numbers below them.
// Tested by tests/tools/tile_signs.cpp through the program.
#pragma once

#include <cstdint>
#include <vector>

#include "sdf/sign/column_sums.h"
#include "tools/tiles/planned_tiles.h"
#include "tools/tiles/tile_folder.h"

namespace bilayer::tools {

class ColumnFiles {
  public:
    ColumnFiles(const TileFolder& folder, const PlannedTiles& tiles) : folder_(folder), tiles_(tiles) {}

    /// Writes the sums of a tile with triangles, unless they are there and intact. Throws as crossingsOf() and
    /// writeColumnSums() do.
    void write(std::size_t tile) const;

    /// Returns the sums below a tile, of files that all ranks have written.
    detail::ColumnSums below(std::size_t tile);

    std::uint64_t readBytes() const { return readBytes_; }  ///< of files, in all

  private:
    const TileFolder& folder_;
    const PlannedTiles& tiles_;
    std::uint64_t readBytes_ = 0;
};

}  // namespace bilayer::tools
