// What the options of a filler or a field come to on a device.
#pragma once

#include <cstdint>
#include <string>

#include <bilayer/cl/filler.h>
#include "cl/detail/program.h"

namespace bilayer::detail {

/// Most device memory to use [bytes].
inline std::uint64_t memoryBudget(const DeviceImpl& device, std::uint64_t memoryMiB) {
    constexpr std::uint64_t mebibyte = 1 << 20;
    return memoryMiB > 0 ? memoryMiB * mebibyte : device.info.memoryBytes / 4 * 3;
}

/// Whether work-items share the work of a group, as on GPUs.
inline bool wantsGroups(const DeviceImpl& device, KernelMapping mapping) {
    return mapping == KernelMapping::automatic ? device.info.gpu : mapping == KernelMapping::groupPerBlock;
}

/// What every program is built with.
/// @param groups     whether work-items share the work of a group
/// @param triangles  whether the nearest triangles are kept
inline std::string commonBuildOptions(const DeviceImpl& device, bool groups = false, bool triangles = false) {
    std::string options = "-cl-std=CL1.2";
    if (device.info.exactSquareRoots) options += " -cl-fp32-correctly-rounded-divide-sqrt";
    if (groups) options += " -D GROUP_PER_BLOCK";
    if (triangles) options += " -D TRIANGLES=1";
    return options;
}

/// Commands in flight use memory that goes with what this stands in: they have ended when this goes, whatever else went
/// wrong. As a member it comes last, to go first.
class Ended {
  public:
    explicit Ended(const cl::CommandQueue& queue) : queue_(queue) {}
    Ended(const Ended&) = delete;
    Ended& operator=(const Ended&) = delete;
    ~Ended() {
        if (queue_()) ::clFinish(queue_());
    }

  private:
    const cl::CommandQueue& queue_;
};

}  // namespace bilayer::detail
