// Distances by a bounding hierarchy and signs by the angle-weighted pseudonormal at the closest feature: J. A.
// Baerentzen, H. Aanaes, "Signed distance computation using the angle weighted pseudonormal", IEEE Transactions on
// Visualization and Computer Graphics 11 (2005) 243-253; the paper calls it AWPN.
#pragma once

#include "sdf/leaf/blocks.h"

namespace bilayer::detail {

/// Fills all blocks that hold a voxel within the job's reach: distances to 1e-5 voxel (beyond 16 voxels in proportion),
/// nearest triangles, and signs: over a face by its normal, elsewhere from linked voxels (links.h) or, where these know
/// nothing, by the pseudonormal. Vertices with equal coordinates are one, and faces with equal vertices count once. The
/// bytes of each block do not depend on the number of threads.
/// Throws std::invalid_argument where makeWideTree() does, and what the sink throws.
void fillPseudonormal(const MeshJob& job);

}  // namespace bilayer::detail
