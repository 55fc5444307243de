// SPDX-License-Identifier: Apache-2.0
// The tiles of a plan, and the memory that they need.
// Tested by tests/tools/tiles.cpp through the program.
#pragma once

#include <cstddef>
#include <glm/vec3.hpp>

#include <bilayer/sdf/build.h>
#include "sdf/tiles/tiling.h"
#include "tools/build.h"
#include "tools/tiles/tile_plan.h"

namespace bilayer::tools {

struct PlannedTiles {
    TilePlan plan;
    BuildOptions options;  ///< with the voxel size and the signs of the plan
    detail::Tiling tiling;

    std::size_t size() const { return tiling.size(); }
    const detail::TileLoad& load(std::size_t tile) const { return plan.loads()[tile]; }

    /// Memory to build a tile [bytes].
    double need(std::size_t tile) const;
    double largestNeed() const;
    /// Memory of a process that joins the records of all tiles [bytes].
    double needOfRecords() const;
};

/// @param counts  of tiles along each axis
PlannedTiles plannedTiles(TilePlan plan, BuildArguments arguments, const glm::ivec3& counts);

}  // namespace bilayer::tools
