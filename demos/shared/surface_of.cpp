// SPDX-License-Identifier: Apache-2.0
#include "demos/shared/surface_of.h"

#include <memory>

#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/surface.h>
#include "sdf/base/openvdb.h"

namespace bilayer::demo {

Mesh surfaceOf(const openvdb::FloatGrid& grid, float adaptivity) {
    if (grid.activeVoxelCount() == 0) return {};
    const auto grids = std::make_shared<Grids>();
    grids->distance = grid.copy();
    return surface(LevelSet(grids), {.adaptivity = adaptivity});
}

}  // namespace bilayer::demo
