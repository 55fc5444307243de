// SPDX-License-Identifier: Apache-2.0
#include "tools/tiles/column_files.h"

#include <filesystem>
#include <stdexcept>

#include "sdf/tiles/tile_columns.h"

namespace bilayer::tools {

using namespace bilayer::detail;

// A killed run may have left a tile's file.
bool ColumnFiles::isWritten(const std::filesystem::path& file) const {
    if (!std::filesystem::exists(file)) return false;
    try {
        readColumnSums(file);
        return true;
    } catch (const std::runtime_error&) {
        return false;  // it is damaged
    }
}

void ColumnFiles::write(std::size_t tile) const {
    const glm::ivec3 place = tiling_.place(tile);
    const TileLoad& load = plan_.loads()[tile];
    if (load.triangles == 0 || isWritten(folder_.sums(place))) return;
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
