// SPDX-License-Identifier: Apache-2.0
// Fills blocks by the build methods on an OpenCL device; the kernels are in cl/kernels. A block is a leaf of
// 8^3 voxels.
#pragma once

#include <cstdint>

#include <bilayer/cl/device.h>
#include <bilayer/sdf/build.h>

namespace bilayer {

/// How the kernels divide the work; the fields are the same.
enum class KernelMapping {
    automatic,      ///< groupPerBlock on GPUs, else blockPerItem
    blockPerItem,   ///< a work-item fills a block, two rows of voxels at once
    groupPerBlock,  ///< 64 work-items fill a block, a row of 8 voxels each
};

/// Options for filling blocks on a device.
struct OpenclOptions {
    /// Limit of device memory [MiB]; 0: three quarters of the device's memory. Blocks stream through it in batches.
    std::uint64_t memoryMiB = 0;
    KernelMapping mapping = KernelMapping::automatic;  ///< how kernels divide the work of a block
    /// Whether the device measures the times in DeviceTimes, which costs an event for each command. Without it only
    /// DeviceTimes::peakBytes is known, and the times are 0.
    bool profile = false;
};

/// Tolerance between the distances of OpenCL and TBB [voxels]: some devices do not round square roots correctly.
inline constexpr float openclMargin = 1e-5f;

/// A filler that fills blocks on a device. While filling it throws DeviceError for errors of the device. It also throws
/// if the memory is too small for the mesh and one brick's work; the text then states how many MiB are needed.
BlockFiller openclFiller(const Device& device, const OpenclOptions& options = {});

}  // namespace bilayer
