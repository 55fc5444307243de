// Translates the options of a filler or a field for a device.
// Tested by tests/cl/filler.cpp.
#pragma once

#include <cstdint>
#include <string>

#include <bilayer/cl/filler.h>
#include "cl/detail/program.h"

namespace bilayer::detail {

/// Limit of device memory [bytes].
inline std::uint64_t memoryBudget(const DeviceImpl& device, std::uint64_t memoryMiB) {
    constexpr std::uint64_t mebibyte = 1 << 20;
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
    if (groups) options += " -D GROUP_PER_BLOCK";
    if (triangles) options += " -D TRIANGLES=1";
    return options;
}

/// Scope guard: its destructor waits until the commands of a queue have ended, also after an error. The commands use
/// memory of the enclosing scope. As a class member it must be declared last, so that it is destroyed first.
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
