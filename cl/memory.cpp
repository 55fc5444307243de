#include "cl/memory.h"

#include <algorithm>

namespace bilayer {
namespace {

constexpr std::uint64_t mebibyte = 1 << 20;

std::string mebibytes(std::uint64_t bytes) {
    return std::to_string((bytes + mebibyte - 1) / mebibyte) + " MiB";
}

}  // namespace

cl::Buffer DeviceMemory::allocate(std::uint64_t bytes, const std::string& purpose) {
    count(bytes, purpose);
    return cl::Buffer(device_.context, CL_MEM_READ_WRITE, bytes);
}

cl::Buffer DeviceMemory::upload(const void* data, std::uint64_t bytes, const std::string& purpose, cl::Event* event) {
    if (!device_.info.unifiedMemory) {
        const cl::Buffer buffer = allocate(bytes, purpose);
        device_.queue.enqueueWriteBuffer(buffer, CL_FALSE, 0, bytes, data, nullptr, event);
        return buffer;
    }
    count(bytes, purpose);
    // OpenCL's signature asks for a pointer to what may change; it is only read
    return cl::Buffer(device_.context, CL_MEM_READ_ONLY | CL_MEM_USE_HOST_PTR, bytes, const_cast<void*>(data));
}

void DeviceMemory::count(std::uint64_t bytes, const std::string& purpose) {
    if (bytes > left() || bytes > device_.info.maxAllocationBytes) refuse(bytes, purpose);
    used_ += bytes;
    peak_ = std::max(peak_, used_);
}

void DeviceMemory::refuse(std::uint64_t bytes, const std::string& purpose) const {
    if (bytes > device_.info.maxAllocationBytes)
        throw DeviceError(purpose + " needs a buffer of " + mebibytes(bytes) + ", and the largest of " +
                          device_.info.name + " is " + mebibytes(device_.info.maxAllocationBytes));
    throw DeviceError(purpose + " needs " + mebibytes(used_ + bytes) + " in all on " + device_.info.name +
                      ", which may use " + mebibytes(budget_));
}

}  // namespace bilayer
