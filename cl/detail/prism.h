// SPDX-License-Identifier: Apache-2.0
// The prism method on an OpenCL device; kernels in prism.cl, host side in prism_bins.h.
#pragma once

#include <bilayer/cl/device.h>
#include <bilayer/cl/filler.h>
#include "sdf/leaf/blocks.h"

namespace bilayer::detail {

/// Fills the blocks of a job whose method is Method::prism. A distance is that to the nearest triangle whose prism
/// contains the voxel, or +infinity if there is none or it is beyond the job's reach. Returns the times of the fill.
///
/// Throws cl::Error, Cancelled, and DeviceError if the memory is too small for one brick's work; the text then states
/// how many MiB are needed.
DeviceTimes fillPrism(DeviceImpl& device, const OpenclOptions& options, const FillJob& job);

}  // namespace bilayer::detail
