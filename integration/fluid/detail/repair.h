// SPDX-License-Identifier: Apache-2.0
// Repairs a combined level set so that openvdb::tools::checkLevelSet accepts it.
// Tested by tests/fluid/repair.cpp through seed().
#pragma once

#include <openvdb/openvdb.h>

namespace bilayer::fluid::detail {

/// Changes of the distances by repair().
struct Changes {
    float largest = 0;       ///< [voxels]
    openvdb::Coord where;    ///< the voxel of the largest change
    std::size_t voxels = 0;  ///< that changed by more than 0.1 voxels
};

/// Changes distances next to the surface until the squared gradient that OpenVDB's check computes is in its range
/// everywhere. Changes are as few and as small as possible. The grid must meet all other conditions of a level set
/// already. Throws std::runtime_error if that fails; the grid is then partly changed.
Changes repair(openvdb::FloatGrid& grid);

}  // namespace bilayer::fluid::detail
