// Points and rays to ask about, each in a random and in a coherent order.
#pragma once

#include <cstddef>
#include <vector>

#include <bilayer/sdf/level_set.h>
#include "bench/peers.h"
#include "bench/race.h"

namespace bilayer::bench {

/// Points evenly over the band less a voxel, as far as all eight voxels around them are active; and the same along
/// Morton's curve through the voxels. None is so near to a cell's face that one who reckons in single precision may see
/// it on the other side, where the gradient is another.
std::vector<Questions<glm::vec3>> pointsInBand(const Field& field, const LevelSet& levelSet, std::size_t count,
                                               unsigned seed);

/// Rays from all around towards the field's box; and those of a pinhole camera, line by line.
std::vector<Questions<Ray>> raysOnto(const Field& field, std::size_t count, unsigned seed);

}  // namespace bilayer::bench
