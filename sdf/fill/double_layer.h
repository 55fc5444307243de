// SPDX-License-Identifier: Apache-2.0
// The double layer method on the CPU: TBB over bricks, SIMD over cubes of voxels.
#pragma once

#include "sdf/leaf/blocks.h"

namespace bilayer::detail {

/// Fills all blocks of a job by the double layer method, with the widest SIMD instructions that the CPU supports.
/// Ignores `MeshJob::reach` and `sign`: `parameters` sets the reach of samples, and every known distance is signed.
/// @param box  bounds of the mesh
void fillDoubleLayer(const MeshJob& job, const Bounds& box, const DoubleLayerOptions& options,
                     const FillParameters& parameters);

/// Returns the name of the SIMD instruction set in use, for reports: "AVX2", "SSE4", ...
const char* simdName();

}  // namespace bilayer::detail
