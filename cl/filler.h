// The double layer method on an OpenCL device; kernels in double_layer.cl.
#pragma once

#include <cstdint>

#include "cl/device.h"
#include "sdf/blocks.h"

namespace bilayer {

struct OpenclOptions {
    /// Most device memory to use [MiB]; 0: three quarters of what the device has. Blocks stream through it in batches.
    std::uint64_t memoryMiB = 0;
};

/// How far the distances of OpenCL and TBB may lie apart [voxels]: square roots are not correctly rounded on all devices.
inline constexpr float openclMargin = 1e-5f;

/// Fills blocks on a device. Throws DeviceError while filling, std::invalid_argument if the memory is too small for one
/// brick's work.
BlockFiller openclFiller(const Device& device, const OpenclOptions& options = {});

}  // namespace bilayer
