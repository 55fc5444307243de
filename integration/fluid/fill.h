// Distances beyond the band, by OpenVDB's fast sweeping.
#pragma once

#include "sdf/level_set.h"

namespace bilayer::fluid {

/// The field with a signed distance in every voxel of its own box: the band's voxels keep their values, the others are
/// swept from them (first order: errors grow with the distance from the band, so errorBound() is NaN: nobody knows a
/// bound that holds for all of them). Dense in memory.
LevelSet fill(const LevelSet& levelSet);

}  // namespace bilayer::fluid
