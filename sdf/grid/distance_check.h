// SPDX-License-Identifier: Apache-2.0
// Checks the distances of a level set that comes from a file; internal.
// Tested by tests/sdf/vdb_io.cpp through readVdb().
#pragma once

#include "sdf/base/openvdb.h"

namespace bilayer::detail {

/// Throws std::invalid_argument in these cases:
/// - a distance is not finite, which rounding, searches and solvers would propagate;
/// - a tile is active, which solvers would fill with voxels;
/// - the stored interior width is not that of inactive voxels inside, or less than that of an active one;
/// - an active voxel outside is beyond the background;
/// - a voxel is too far from the origin of the grid.
/// @param interiorWidth  LevelSet::interiorWidth() [m]
void requireValidDistances(const openvdb::FloatGrid& grid, float interiorWidth);

}  // namespace bilayer::detail
