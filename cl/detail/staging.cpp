// SPDX-License-Identifier: Apache-2.0
#include "cl/detail/staging.h"

#include <exception>
#include <utility>

namespace bilayer::detail {
namespace {

PinnedMemory takePinned(DeviceImpl& device) {
    const std::lock_guard lock(device.mutex);
    if (device.pinned.empty()) return {};
    PinnedMemory memory = std::move(device.pinned.back());
    device.pinned.pop_back();
    return memory;
}

PinnedMemory allocatePinned(const DeviceImpl& device) {
    constexpr std::size_t bytes = 2 * Staging::halfBytes;
    const cl::Buffer buffer(device.context, CL_MEM_READ_WRITE | CL_MEM_ALLOC_HOST_PTR, bytes);
    return {buffer, device.queue.enqueueMapBuffer(buffer, CL_TRUE, CL_MAP_READ | CL_MAP_WRITE, 0, bytes)};
}

}  // namespace

Staging::Staging(DeviceImpl& device) : device_(device), memory_(takePinned(device)) {
    if (!memory_.address) memory_ = allocatePinned(device);
    bytes_ = static_cast<std::byte*>(memory_.address);
}

Staging::~Staging() {
    try {
        const std::lock_guard lock(device_.mutex);
        device_.pinned.push_back(std::move(memory_));
    } catch (const std::exception&) {
        // without memory for the list it is freed
    }
}

}  // namespace bilayer::detail
