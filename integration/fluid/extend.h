// SPDX-License-Identifier: Apache-2.0
// Extends a level set beyond its band, by OpenVDB's fast sweeping.
#pragma once

#include <bilayer/sdf/level_set.h>

namespace bilayer::fluid {

/// Extends the field to a signed distance in every voxel of its own box. The band's voxels keep their values; fast
/// sweeping computes the others from them. It is first order: errors grow with the distance from the band, and no bound
/// holds for all voxels, so errorBound() is NaN. The result is dense in memory. Throws std::invalid_argument for a
/// field without inside, where no distance can start, and for a box that does not fit the machine's memory.
LevelSet extend(const LevelSet& levelSet);

/// Extends the field up to a distance from the surface on either side [m], which is then the field's width. A side of
/// the band that is as wide already keeps its own width. Also throws for a distance that is not positive or not finite.
LevelSet extend(const LevelSet& levelSet, float distance);

}  // namespace bilayer::fluid
