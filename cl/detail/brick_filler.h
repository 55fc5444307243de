// SPDX-License-Identifier: Apache-2.0
// The methods that fill brick by brick on a device. Triangles are binned into bricks and cut into parts, and blocks are
// filled from the parts. Bricks stream through the device's memory in batches.
// Tested by tests/cl/filler.cpp through openclFiller().
#pragma once

#include <functional>

#include <bilayer/cl/filler.h>
#include "cl/detail/program.h"
#include "sdf/leaf/blocks.h"

namespace bilayer::detail {

/// Receives filled blocks on the device, in the layout of FilledBlocks. It must enqueue all commands that read the
/// buffers in the device's queue before it returns.
using DeviceSink = std::function<void(const cl::Buffer& origins, const cl::Buffer& distances, std::size_t blocks)>;

/// Fills all blocks of a job by Method::exact or Method::doubleLayer.
/// @param keep  if not null, gets the blocks that the device filled; the job's sink gets all others
/// @return the times of the fill
DeviceTimes fillByBricks(DeviceImpl& device, const OpenclOptions& options, const FillJob& job,
                         const DeviceSink& keep = {});

}  // namespace bilayer::detail
