// The double layer method on an OpenCL device; kernels in double_layer.cl.
#pragma once

#include <cstdint>

#include "cl/device.h"
#include "sdf/blocks.h"

namespace bilayer {

/// How the kernel shares a block of 8x8x8 voxels out; the distances are the same.
enum class KernelMapping {
    automatic,     ///< rowPerItem on GPUs, else blockPerItem
    blockPerItem,  ///< a work-item fills a block, row by row in vectors
    rowPerItem,    ///< 64 work-items fill a block, a row of 8 voxels each
};

struct OpenclOptions {
    /// Most device memory to use [MiB]; 0: three quarters of what the device has. Blocks stream through it in batches.
    std::uint64_t memoryMiB = 0;
    KernelMapping mapping = KernelMapping::automatic;
};

/// How far the distances of OpenCL and TBB may lie apart [voxels]: square roots are not correctly rounded on all
/// devices.
inline constexpr float openclMargin = 1e-5f;

/// Fills blocks on a device. While filling it throws DeviceError: for the device's own trouble, and where the memory is
/// too small for the mesh and one brick's work; the text then says how many MiB are needed.
BlockFiller openclFiller(const Device& device, const OpenclOptions& options = {});

}  // namespace bilayer
