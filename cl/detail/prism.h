// The prism method on an OpenCL device; kernels in prism.cl, what the host prepares in prism_bins.h.
#pragma once

#include <bilayer/cl/device.h>
#include <bilayer/cl/filler.h>
#include "sdf/leaf/blocks.h"

namespace bilayer::detail {

/// Fills the blocks of a job whose method is Method::prism. Distances are those to the nearest of the triangles whose
/// prism holds the voxel, +infinity where none does or beyond the job's reach.
/// Throws cl::Error, Cancelled, and DeviceError where the memory is too small for one brick's work; the text then says
/// how many MiB are needed.
void fillPrism(DeviceImpl& device, const OpenclOptions& options, const FillJob& job);

}  // namespace bilayer::detail
