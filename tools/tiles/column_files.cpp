// SPDX-License-Identifier: Apache-2.0
#include "tools/tiles/column_files.h"

#include <filesystem>

#include "sdf/tiles/hashed_record.h"
#include "sdf/tiles/tile_columns.h"

namespace bilayer::tools {

using namespace bilayer::detail;

void ColumnFiles::write(std::size_t tile) const {
    const glm::ivec3 place = tiles_.tiling.place(tile);
    const TileLoad& load = tiles_.load(tile);
    if (load.triangles == 0) return;
    // a killed run may have left the file
    const bool isWritten = passes([&] {
        readColumnSums(folder_.sums(place));
        return true;
    });
    if (isWritten) return;
    const std::vector<TileTriangle> triangles = readTileTriangles(folder_.triangles(place), load);
    writeColumnSums(folder_.sums(place), crossingsOf(triangles, tiles_.tiling, tile, tiles_.plan.voxelSize()));
}

ColumnSums ColumnFiles::below(std::size_t tile) {
    return crossingsBelow(tiles_.tiling, tile, [&](std::size_t other) {
        if (tiles_.load(other).triangles == 0) return ColumnSums({0, 0}, {0, 0});
        const std::filesystem::path file = folder_.sums(tiles_.tiling.place(other));
        ColumnSums sums = readColumnSums(file);
        readBytes_ += std::filesystem::file_size(file);
        return sums;
    });
}

}  // namespace bilayer::tools
