// Distances beyond the band, by OpenVDB's fast sweeping.
#pragma once

#include <bilayer/sdf/level_set.h>

namespace bilayer::fluid {

/// The field with a signed distance in every voxel of its own box: the band's voxels keep their values, the others are
/// swept from them (first order: errors grow with the distance from the band, so errorBound() is NaN: nobody knows a
/// bound that holds for all of them). Dense in memory. Throws std::invalid_argument for a field without inside, where
/// no distance can begin, and for a box that the machine's memory does not hold.
LevelSet fill(const LevelSet& levelSet);

/// The same as far as a distance from the surface on either side [m], which is then the field's width; a side of the
/// band that is as wide already keeps its own. Throws as well for a distance that is not positive or not finite.
LevelSet fill(const LevelSet& levelSet, float distance);

}  // namespace bilayer::fluid
