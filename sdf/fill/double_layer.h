// The double layer method on the processor: TBB over bricks, SIMD over cubes of voxels.
#pragma once

#include "sdf/leaf/blocks.h"

namespace bilayer::detail {

/// Fills all blocks of a job by the double layer method, with the widest SIMD instructions that the processor has.
/// `MeshJob::reach` and `sign` follow from the method: `parameters` tells how far samples reach, and every known
/// distance has its sign.
/// @param box  of the mesh
void fillDoubleLayer(const MeshJob& job, const Bounds& box, const DoubleLayerOptions& options,
                     const FillParameters& parameters);

/// The name of the SIMD instruction set in use, for reports: "AVX2", "SSE4", ...
const char* simdName();

}  // namespace bilayer::detail
