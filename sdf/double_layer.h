// The double layer method on the processor: TBB over bricks, SIMD along rows of voxels.
#pragma once

#include "sdf/blocks.h"

namespace bilayer {

/// Fills blocks with TBB on all cores, with the widest SIMD instructions that the processor has.
BlockFiller tbbFiller();

/// The name of the SIMD instruction set in use, for reports: "AVX2", "SSE4", ...
const char* simdName();

}  // namespace bilayer
