// The exact method on the processor: in each block the samples of pieces of triangles tell which pieces can be nearest
// to a voxel, those pieces tell the distance, and the closest feature tells the side.
#pragma once

#include "sdf/leaf/blocks.h"

namespace bilayer::detail {

/// Fills all blocks of a job by TBB and SIMD. Distances are right within 1e-4 voxels of the true ones. Their bytes do
/// not depend on the number of threads, on the order of the triangles, or on a shift by whole voxels (where the voxel
/// size and the vertices are binary fractions, so that the shift itself is exact).
/// @param box  of the mesh
void fillExact(const MeshJob& job, const Bounds& box);

}  // namespace bilayer::detail
