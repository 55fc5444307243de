// SPDX-License-Identifier: Apache-2.0
// Translates the options of a filler or a field for a device, and holds the constants of all kernels.
// Tested by tests/cl/filler.cpp through openclFiller().
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include <bilayer/cl/filler.h>
#include "cl/detail/memory.h"
#include "cl/detail/program.h"

namespace bilayer::detail {

/// Work-items of a group on a GPU: ITEMS of common.cl.
inline constexpr std::size_t groupItems = 64;
/// While the device works on one batch, the host works on the other.
inline constexpr std::size_t batchesInFlight = 2;

/// Limit of device memory [bytes].
inline std::uint64_t memoryBudget(const DeviceImpl& device, std::uint64_t memoryMiB) {
    return memoryMiB > 0 ? memoryMiB * mebibyte : device.info.memoryBytes / 4 * 3;
}

/// Whether work-items share the work of a group, as on GPUs.
inline bool wantsGroups(const DeviceImpl& device, KernelMapping mapping) {
    return mapping == KernelMapping::automatic ? device.info.gpu : mapping == KernelMapping::groupPerBlock;
}

/// Build options of every program.
inline std::string commonBuildOptions(const DeviceImpl& device, bool groups = false, bool triangles = false) {
    std::string options = "-cl-std=CL1.2";
    if (device.info.exactSquareRoots) options += " -cl-fp32-correctly-rounded-divide-sqrt";
    if (!device.info.gpu) options += " -D ON_PROCESSOR=1";
    if (groups) options += " -D GROUP_PER_BLOCK";
    if (triangles) options += " -D TRIANGLES=1";
    return options;
}

/// Throws DeviceError if the device has no double precision.
/// @param need  who needs it, for the error text: "which samples of fields need"
inline void requireDoubles(const DeviceInfo& device, const std::string& need) {
    if (!device.doubles) throw DeviceError(device.name + " cannot compute in double precision, " + need);
}

}  // namespace bilayer::detail
