// The methods that work brick by brick on a device: triangles are binned into bricks, cut into parts, and blocks filled
// from those; bricks stream through the device's memory in batches.
#pragma once

#include "cl/filler.h"
#include "cl/program.h"

namespace bilayer {

/// Fills all blocks of a job by Method::exact or Method::doubleLayer. Throws as openclFiller()'s does.
void fillByBricks(Device::Impl& device, const OpenclOptions& options, const FillJob& job);

}  // namespace bilayer
