// SPDX-License-Identifier: Apache-2.0
// Distances from a bounding volume hierarchy, and signs from the angle-weighted pseudonormal at the closest feature: J.
// A. Baerentzen, H. Aanaes, "Signed distance computation using the angle weighted pseudonormal", IEEE Transactions on
// Visualization and Computer Graphics 11 (2005) 243-253; the paper calls it AWPN.
#pragma once

#include "sdf/leaf/blocks.h"

namespace bilayer::detail {

/// Fills all blocks that contain a voxel within the job's reach. Distances are accurate to 1e-5 voxel, in proportion
/// beyond 16 voxels. Also gives the nearest triangles and the signs. Where the closest point is inside a face, the face
/// normal gives the sign. Elsewhere the sign comes from linked voxels (sign_propagation.h) or, if these have none, from
/// the pseudonormal.
/// Vertices with equal coordinates count as one, and faces with equal vertices count once. The bytes of each block do
/// not depend on the thread count.
/// Throws std::invalid_argument where makeWideTree() does, and what the sink throws.
void fillPseudonormal(const MeshJob& job);

}  // namespace bilayer::detail
