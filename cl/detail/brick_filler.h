// The methods that work brick by brick on a device: triangles are binned into bricks, cut into parts, and blocks filled
// from those; bricks stream through the device's memory in batches.
#pragma once

#include <functional>
#include <limits>

#include <bilayer/cl/filler.h>
#include "cl/detail/program.h"

namespace bilayer::detail {

/// Takes filled blocks over on the device, as FilledBlocks has them: commands that read the buffers go into the
/// device's queue before it returns.
using DeviceSink = std::function<void(const cl::Buffer& origins, const cl::Buffer& distances, std::size_t blocks)>;

/// Fills all blocks of a job by Method::exact or Method::doubleLayer.
/// @param keep  gets the blocks that the device filled, if it is not null; the job's sink gets all others
/// Throws as openclFiller()'s does.
void fillByBricks(DeviceImpl& device, const OpenclOptions& options, const FillJob& job, const DeviceSink& keep = {});

/// The x of a slot's origin where the slot is left empty.
inline constexpr int noBlock = std::numeric_limits<int>::min();

}  // namespace bilayer::detail
