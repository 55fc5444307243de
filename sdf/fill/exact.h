// SPDX-License-Identifier: Apache-2.0
// The exact method on the CPU. In each block the samples of triangle pieces select the pieces that can be nearest to a
// voxel. These pieces give the distance, and the closest feature gives the sign.
// Tested by tests/sdf/exact.cpp through build().
#pragma once

#include "sdf/leaf/blocks.h"

namespace bilayer::detail {

/// Fills all blocks of a job with TBB and SIMD. Distances are within 1e-4 voxels of the true ones. Their bytes do not
/// depend on the thread count, on the triangle order, or on a shift by whole voxels. The latter requires a voxel size
/// and vertices that are binary fractions, so that the shift itself is exact.
/// @param box  bounds of the mesh
void fillExact(const MeshJob& job, const Bounds& box);

/// Whether fillExact() checks its certificate for every voxel: the library is compiled with BILAYER_VERIFY. It then
/// throws std::logic_error where an obligation does not hold.
bool exactIsVerified();

}  // namespace bilayer::detail
