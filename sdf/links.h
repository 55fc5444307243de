// Which voxels of a block must lie on the same side of the surface. The ball around a voxel with its distance as radius
// is free of surface; where the balls of two neighbours overlap (d1 + d2 > 1 voxel), so is the way between them: they
// are linked. A side found for one voxel then holds for all that links connect with it.
#pragma once

#include <cstdint>

#include "sdf/band.h"

namespace bilayer {

/// Slack of the test for a link, far above the rounding of distances [voxels].
inline constexpr float linkSlack = 1e-4f;

/// Links inside a block. Bit of voxel v: v is linked with its next neighbour along the axis.
struct Links {
    BlockMask x, y, z;
};

/// Adds to a set all voxels that links connect with it.
void spread(const Links& links, BlockMask& set);

}  // namespace bilayer
