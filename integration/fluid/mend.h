// Makes a combined level set one again in the sense of openvdb::tools::checkLevelSet.
#pragma once

#include <openvdb/openvdb.h>

namespace bilayer::fluid {

/// Changes the distances next to the surface, by parts of a voxel and only where it is needed, until the squared
/// gradient that OpenVDB's check computes lies in its range everywhere. It must be a level set in every other sense
/// already. Throws std::runtime_error if that fails; the grid is then in between.
void mend(openvdb::FloatGrid& grid);

}  // namespace bilayer::fluid
