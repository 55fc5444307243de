// SPDX-License-Identifier: Apache-2.0
#include "tools/tiles/column_files.h"

#include <filesystem>

#include "sdf/tiles/hashed_record.h"
#include "sdf/tiles/tile_columns.h"

namespace bilayer::tools {

using namespace bilayer::detail;

void ColumnFiles::write(std::size_t tile) const {
    const glm::ivec3 place = tiling_.place(tile);
    const TileLoad& load = plan_.loads()[tile];
    if (load.triangles == 0) return;
    // a killed run may have left the file
    const bool isWritten = passes([&] {
        readColumnSums(folder_.sums(place));
        return true;
    });
    if (isWritten) return;
    const std::vector<TileTriangle> triangles = readTileTriangles(folder_.triangles(place), load);
    writeColumnSums(folder_.sums(place), crossingsOf(triangles, tiling_, tile, plan_.voxelSize()));
}

ColumnSums ColumnFiles::below(std::size_t tile) {
    return crossingsBelow(tiling_, tile, [&](std::size_t other) {
        if (plan_.loads()[other].triangles == 0) return ColumnSums({0, 0}, {0, 0});
        const std::filesystem::path file = folder_.sums(tiling_.place(other));
        ColumnSums sums = readColumnSums(file);
        readBytes_ += std::filesystem::file_size(file);
        return sums;
    });
}

}  // namespace bilayer::tools
