// SPDX-License-Identifier: Apache-2.0
// Points and rays for queries, each in a random and in a coherent order.
#pragma once

#include <cstddef>
#include <vector>

#include <bilayer/sdf/level_set.h>
#include "bench/peers.h"
#include "bench/race.h"

namespace bilayer::bench {

/// Points uniformly distributed in the band without its outermost voxel, where all eight surrounding voxels are active;
/// and the same points in Morton order of their voxels. No point is so close to a cell face that single precision may
/// put it on the other side, where the gradient differs.
std::vector<Questions<glm::vec3>> pointsInBand(const Field& field, const LevelSet& levelSet, std::size_t count,
                                               unsigned seed);

/// Rays from all around towards the field's box; and those of a pinhole camera, line by line.
std::vector<Questions<Ray>> raysOnto(const Field& field, std::size_t count, unsigned seed);

}  // namespace bilayer::bench
