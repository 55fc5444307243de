// SPDX-License-Identifier: Apache-2.0
// Fills blocks by the build methods on an OpenCL device; the kernels are in cl/kernels. A block is a leaf of
// 8^3 voxels.
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>

#include <bilayer/cl/device.h>
#include <bilayer/sdf/build.h>

namespace bilayer {

/// How the kernels divide the work; the fields are the same.
enum class KernelMapping {
    automatic,      ///< groupPerBlock on GPUs, else blockPerItem
    blockPerItem,   ///< a work-item fills a block, two rows of voxels at once
    groupPerBlock,  ///< 64 work-items fill a block, a row of 8 voxels each
};

/// Device times of builds or samples, by the events of the queues, and device memory.
struct OpenclTimes {
    double kernels = 0;           ///< overlapping kernels count once [s]
    double upload = 0;            ///< to the device; 0 if it shares the host's memory [s]
    double download = 0;          ///< from the device [s]
    std::uint64_t peakBytes = 0;  ///< peak device memory [bytes]

    /// Adds the times of another call. The peak is the larger one.
    OpenclTimes& operator+=(const OpenclTimes& other) {
        kernels += other.kernels;
        upload += other.upload;
        download += other.download;
        peakBytes = std::max(peakBytes, other.peakBytes);
        return *this;
    }
};

/// Options for filling blocks on a device.
struct OpenclOptions {
    /// Limit of device memory [MiB]; 0: three quarters of the device's memory. Blocks stream through it in batches.
    std::uint64_t memoryMiB = 0;
    KernelMapping mapping = KernelMapping::automatic;  ///< how kernels divide the work of a block
    /// Whether the device measures the times in OpenclTimes, which costs an event for each command. Without it only
    /// OpenclTimes::peakBytes is known, and the times are 0.
    bool profile = false;
};

/// Tolerance between the distances of OpenCL and TBB [voxels]: some devices do not round square roots correctly.
inline constexpr float openclMargin = 1e-5f;

/// A filler on a device, with its times.
struct OpenclFiller : BlockFiller {
    std::function<OpenclTimes()> times;  ///< of all builds so far by this filler and its copies
};

/// A filler that fills blocks on a device. While filling it throws DeviceError for errors of the device. It also throws
/// if the memory is too small for the mesh and one brick's work; the text then states how many MiB are needed.
OpenclFiller openclFiller(const Device& device, const OpenclOptions& options = {});

}  // namespace bilayer
