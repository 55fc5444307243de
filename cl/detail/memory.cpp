// SPDX-License-Identifier: Apache-2.0
#include "cl/detail/memory.h"

#include <algorithm>
#include <exception>

namespace bilayer::detail {
namespace {

/// Maximum memory that a device keeps between builds.
constexpr std::uint64_t maxSpareBytes = 128 * mebibyte;

std::uint64_t sizeOf(const cl::Buffer& buffer) {
    return buffer.getInfo<CL_MEM_SIZE>();
}

std::string mebibytes(std::uint64_t bytes) {
    return std::to_string((bytes + mebibyte - 1) / mebibyte) + " MiB";
}

}  // namespace

cl::Buffer DeviceMemory::allocate(std::uint64_t bytes, const std::string& purpose) {
    count(bytes, purpose);
    cl::Buffer buffer = takeSpare(bytes);
    if (!buffer()) buffer = cl::Buffer(device_.context, CL_MEM_READ_WRITE, bytes);
    taken_.push_back(buffer);
    return buffer;
}

// Returns null if there is none of this size. Buffers of other sizes are then freed if the budget would be exceeded.
cl::Buffer DeviceMemory::takeSpare(std::uint64_t bytes) {
    const std::lock_guard lock(device_.mutex);
    const auto found = device_.spares.find(bytes);
    cl::Buffer buffer;
    if (found != device_.spares.end()) {
        buffer = found->second;
        device_.spareBytes -= bytes;
        device_.spares.erase(found);
    } else if (used_ + device_.spareBytes > budget_) {
        clearSpares();
    }
    return buffer;
}

void DeviceMemory::clearSpares() {
    device_.spares.clear();
    device_.spareBytes = 0;
}

// Does not keep buffers that are still mapped, as after an error.
void DeviceMemory::keepSpare(const cl::Buffer& buffer) {
    if (buffer.getInfo<CL_MEM_MAP_COUNT>() > 0) return;
    const std::uint64_t bytes = sizeOf(buffer);
    const std::lock_guard lock(device_.mutex);
    if (bytes > maxSpareBytes) return;
    if (device_.spareBytes + bytes > maxSpareBytes) clearSpares();
    device_.spares.emplace(bytes, buffer);
    device_.spareBytes += bytes;
}

void DeviceMemory::free(cl::Buffer& buffer) {
    if (!buffer()) return;
    used_ -= sizeOf(buffer);
    const auto taken = std::find(taken_.begin(), taken_.end(), buffer);
    if (taken != taken_.end()) {
        keepSpare(buffer);
        taken_.erase(taken);
    }
    buffer = {};
}

DeviceMemory::~DeviceMemory() {
    try {
        for (const cl::Buffer& buffer : taken_) keepSpare(buffer);
    } catch (const std::exception&) {
        // a device that is lost keeps nothing
    }
}

cl::Buffer DeviceMemory::upload(const void* data, std::uint64_t bytes, const std::string& purpose, cl::Event* event) {
    if (!device_.info.unifiedMemory) {
        const cl::Buffer buffer = allocate(bytes, purpose);
        device_.queue.enqueueWriteBuffer(buffer, CL_FALSE, 0, bytes, data, nullptr, event);
        return buffer;
    }
    count(bytes, purpose);
    // OpenCL's signature takes a pointer to mutable data; it is only read
    return cl::Buffer(device_.context, CL_MEM_READ_ONLY | CL_MEM_USE_HOST_PTR, bytes, const_cast<void*>(data));
}

void DeviceMemory::count(std::uint64_t bytes, const std::string& purpose) {
    if (bytes > freeBytes() || bytes > device_.info.maxAllocationBytes) refuse(bytes, purpose);
    used_ += bytes;
    peak_ = std::max(peak_, used_);
}

void DeviceMemory::refuse(std::uint64_t bytes, const std::string& purpose) const {
    if (bytes > device_.info.maxAllocationBytes)
        throw DeviceError(purpose + " needs a buffer of " + mebibytes(bytes) + ", and the largest of " +
                          device_.info.name + " is " + mebibytes(device_.info.maxAllocationBytes));
    throw DeviceError(purpose + " needs at least " + mebibytes(used_ + bytes) + " in all on " + device_.info.name +
                      ", which may use " + mebibytes(budget_));
}

}  // namespace bilayer::detail
