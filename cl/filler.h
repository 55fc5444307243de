// The methods on an OpenCL device; kernels in the .cl files of this folder.
#pragma once

#include <cstdint>

#include <bilayer/cl/device.h>
#include <bilayer/sdf/build.h>

namespace bilayer {

/// How the kernels share work out; the fields are the same.
enum class KernelMapping {
    automatic,      ///< groupPerBlock on GPUs, else blockPerItem
    blockPerItem,   ///< a work-item fills a block, two rows of voxels at once
    groupPerBlock,  ///< 64 work-items fill a block, a row of 8 voxels each
};

/// What a build took on the device, by the events of its queues, and how much memory.
struct OpenclTimes {
    double kernels = 0;           ///< [s]
    double upload = 0;            ///< to the device; none where it shares the host's memory [s]
    double download = 0;          ///< from the device [s]
    std::uint64_t peakBytes = 0;  ///< most device memory in use at once
};

struct OpenclOptions {
    /// Most device memory to use [MiB]; 0: three quarters of what the device has. Blocks stream through it in batches.
    std::uint64_t memoryMiB = 0;
    KernelMapping mapping = KernelMapping::automatic;
    OpenclTimes* times = nullptr;  ///< if not null, each build adds what it took
};

/// How far the distances of OpenCL and TBB may lie apart [voxels]: square roots are not correctly rounded on all
/// devices.
inline constexpr float openclMargin = 1e-5f;

/// Fills blocks on a device. While filling it throws DeviceError: for the device's own trouble, and where the memory is
/// too small for the mesh and one brick's work; the text then says how many MiB are needed.
BlockFiller openclFiller(const Device& device, const OpenclOptions& options = {});

}  // namespace bilayer
