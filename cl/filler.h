// Fills blocks by the build methods on an OpenCL device; kernels in the .cl files of this folder. A block is a leaf of
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

/// Time of a build on the device, by the events of its queues, and its memory.
struct OpenclTimes {
    double kernels = 0;           ///< [s]
    double upload = 0;            ///< to the device; 0 if it shares the host's memory [s]
    double download = 0;          ///< from the device [s]
    std::uint64_t peakBytes = 0;  ///< peak device memory [bytes]
};

struct OpenclOptions {
    /// Limit of device memory [MiB]; 0: three quarters of the device's memory. Blocks stream through it in batches.
    std::uint64_t memoryMiB = 0;
    KernelMapping mapping = KernelMapping::automatic;
    OpenclTimes* times = nullptr;  ///< if not null, each build adds its times
};

/// Tolerance between the distances of OpenCL and TBB [voxels]: some devices do not round square roots correctly.
inline constexpr float openclMargin = 1e-5f;

/// A filler that fills blocks on a device. While filling it throws DeviceError for errors of the device. It also throws
/// if the memory is too small for the mesh and one brick's work; the text then states how many MiB are needed.
BlockFiller openclFiller(const Device& device, const OpenclOptions& options = {});

}  // namespace bilayer
