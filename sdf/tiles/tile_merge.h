// SPDX-License-Identifier: Apache-2.0
// Joins the tiles of a field into one grid.
// Tested by tests/sdf/field_tiles.cpp.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/level_set.h>
#include "sdf/base/progress.h"
#include "sdf/grid/assemble.h"

namespace bilayer::detail {

/// Throws std::invalid_argument unless two tiles have the same voxels, widths and metadata, as tiles of one field do.
void requireSameField(const openvdb::FloatGrid& first, const openvdb::FloatGrid& tile);

/// Takes tiles one by one, in any order. Its memory is that of the tiles that it has taken.
class TileMerger {
  public:
    TileMerger() : progress_(never_) {}

    /// Adds a tile as buildTile() made it, or as it was read from a file. Throws std::invalid_argument if it is not a
    /// tile of the same field as the others.
    void add(const Grids& tile);

    /// Returns the whole field. Its grids and metadata equal those of build(). Call it once. Throws
    /// std::invalid_argument if there is no voxel in the band, or if the signs of two tiles contradict each other.
    LevelSet merged();

  private:
    void begin(const openvdb::FloatGrid& first, bool triangles);
    void addSpace(const openvdb::FloatGrid& tile);

    std::function<bool(float)> never_;
    Progress progress_;
    openvdb::FloatGrid::Ptr first_;  // the metadata of the first tile, without its tree
    std::int64_t undecided_ = 0;
    std::optional<Assembler> assembler_;
    std::vector<openvdb::CoordBBox> inside_;  // space of a flood, which leaves do not determine
};

}  // namespace bilayer::detail
