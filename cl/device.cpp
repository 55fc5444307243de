// SPDX-License-Identifier: Apache-2.0
#include <bilayer/cl/device.h>

#include <algorithm>
#include <cctype>
#include <cstdlib>

#include "cl/detail/program.h"
#include "sdf/base/access.h"

namespace bilayer {

using namespace detail;

namespace {

constexpr cl_int noPlatform = -1001;  // CL_PLATFORM_NOT_FOUND_KHR, of the loader's extension cl_khr_icd

struct FoundDevice {
    cl::Device device;
    DeviceInfo info;
};

DeviceInfo describe(const cl::Platform& platform, const cl::Device& device) {
    const cl_device_type type = device.getInfo<CL_DEVICE_TYPE>();
    const cl_device_fp_config floats = device.getInfo<CL_DEVICE_SINGLE_FP_CONFIG>();
    return {.platform = platform.getInfo<CL_PLATFORM_NAME>(),
            .name = device.getInfo<CL_DEVICE_NAME>(),
            .version = device.getInfo<CL_DEVICE_VERSION>(),
            .platformVersion = platform.getInfo<CL_PLATFORM_VERSION>(),
            .driver = device.getInfo<CL_DRIVER_VERSION>(),
            .gpu = (type & CL_DEVICE_TYPE_GPU) != 0,
            .unifiedMemory = device.getInfo<CL_DEVICE_HOST_UNIFIED_MEMORY>() == CL_TRUE,
            .exactSquareRoots = (floats & CL_FP_CORRECTLY_ROUNDED_DIVIDE_SQRT) != 0,
            .doubles = device.getInfo<CL_DEVICE_DOUBLE_FP_CONFIG>() != 0,
            .computeUnits = device.getInfo<CL_DEVICE_MAX_COMPUTE_UNITS>(),
            .memoryBytes = device.getInfo<CL_DEVICE_GLOBAL_MEM_SIZE>(),
            .maxAllocationBytes = device.getInfo<CL_DEVICE_MAX_MEM_ALLOC_SIZE>()};
}

// Usable devices in platform order, GPUs first.
std::vector<FoundDevice> findDevices() {
    std::vector<FoundDevice> found;
    try {
        std::vector<cl::Platform> platforms;
        cl::Platform::get(&platforms);
        for (const cl::Platform& platform : platforms) {
            std::vector<cl::Device> all;
            platform.getDevices(CL_DEVICE_TYPE_ALL, &all);
            for (const cl::Device& device : all)
                if (device.getInfo<CL_DEVICE_AVAILABLE>() && device.getInfo<CL_DEVICE_COMPILER_AVAILABLE>())
                    found.push_back({device, describe(platform, device)});
        }
    } catch (const cl::Error& error) {
        if (error.err() != noPlatform) throw deviceError(error, "any device, while listing them");
    }
    std::stable_partition(found.begin(), found.end(), [](const FoundDevice& f) { return f.info.gpu; });
    return found;
}

std::string lowered(std::string text) {
    std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return char(std::tolower(c)); });
    return text;
}

std::string listed(const std::vector<FoundDevice>& found) {
    std::string list;
    for (const FoundDevice& f : found) list += (list.empty() ? "" : ", ") + f.info.name + " (" + f.info.platform + ")";
    return list;
}

FoundDevice choose(const std::string& text) {
    const std::vector<FoundDevice> found = findDevices();
    if (found.empty())
        throw DeviceError(
            "there is no OpenCL device on this machine: no driver is installed, or none finds its hardware (PoCL also "
            "needs a "
            "folder that it can write to: $POCL_CACHE_DIR, or ~/.cache)");
    const std::string wanted = lowered(text);
    const auto fits = [&](const FoundDevice& f) {
        return lowered(f.info.name).find(wanted) != std::string::npos ||
               lowered(f.info.platform).find(wanted) != std::string::npos;
    };
    const auto chosen = std::find_if(found.begin(), found.end(), fits);
    if (chosen == found.end())
        throw DeviceError("no OpenCL device is called '" + text + "'; there is " + listed(found));
    return *chosen;
}

}  // namespace

const DeviceInfo& Device::info() const {
    return data_->info;
}

std::vector<DeviceInfo> devices() {
    std::vector<DeviceInfo> infos;
    for (FoundDevice& f : findDevices()) infos.push_back(std::move(f.info));
    return infos;
}

Device openDevice(const std::string& text) {
    const char* fallback = std::getenv("BILAYER_DEVICE");
    const FoundDevice found = choose(text.empty() && fallback ? fallback : text);
    auto impl = std::make_shared<DeviceImpl>();
    impl->info = found.info;
    impl->device = found.device;
    try {
        impl->context = cl::Context(found.device);
        impl->queue = cl::CommandQueue(impl->context, found.device, CL_QUEUE_PROFILING_ENABLE);
    } catch (const cl::Error& error) {
        throw deviceError(error, found.info.name);
    }
    return makeOf<Device>(std::move(impl));
}

}  // namespace bilayer
