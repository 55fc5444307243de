// Makes a combined level set one again in the sense of openvdb::tools::checkLevelSet.
#pragma once

#include <openvdb/openvdb.h>

namespace bilayer::fluid::detail {

/// What repair() did to the distances.
struct Changes {
    float largest = 0;       ///< [voxels]
    openvdb::Coord where;    ///< the voxel of the largest change
    std::size_t voxels = 0;  ///< that changed by more than a tenth of a voxel
};

/// Changes the distances next to the surface, as little as it can and only where it is needed, until the squared
/// gradient that OpenVDB's check computes lies in its range everywhere. It must be a level set in every other sense
/// already. Throws std::runtime_error if that fails; the grid is then in between.
Changes repair(openvdb::FloatGrid& grid);

}  // namespace bilayer::fluid::detail
