// SPDX-License-Identifier: Apache-2.0
// The implementation of Device, for the files of this folder and their tests: OpenCL objects, compiled programs, error
// texts.
#pragma once

#define CL_HPP_ENABLE_EXCEPTIONS
#define CL_HPP_TARGET_OPENCL_VERSION 120
#define CL_HPP_MINIMUM_OPENCL_VERSION 120
#include <CL/opencl.hpp>
#include <cstdint>
#include <filesystem>
#include <map>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include <bilayer/cl/device.h>

namespace bilayer::detail {

/// A buffer in host memory, and its address while it is mapped.
struct PinnedMemory {
    cl::Buffer buffer;
    void* address = nullptr;
};

struct DeviceImpl {
    DeviceInfo info;
    cl::Device device;
    cl::Context context;
    cl::CommandQueue queue;                                               // in-order queue
    std::mutex mutex;                                                     // guards the members below
    std::map<std::pair<std::string, std::string>, cl::Program> programs;  // by source and build options
    std::multimap<std::uint64_t, cl::Buffer> spares;                      // by size; see memory.h
    std::uint64_t spareBytes = 0;
    std::multimap<std::pair<cl_program, std::string>, cl::Kernel> kernels;  // that no thread uses; by program and name
    std::vector<PinnedMemory> pinned;                                       // that no build uses; see staging.h
};

/// The name of an OpenCL error code, "CL_OUT_OF_RESOURCES"; "code -9999" for one that is not in the standard.
std::string errorName(cl_int code);

/// Converts an exception of an OpenCL call to text: the call, the code's name, the device, and the log of a failed
/// build.
DeviceError deviceError(const cl::Error& error, const std::string& deviceName);

/// Returns a program built for the device: from its memory, from the cache on disk, or compiled and stored in both. A
/// cache that cannot be read or written is ignored. Throws DeviceError with the build log if the source does not
/// compile.
cl::Program buildProgram(DeviceImpl& device, const std::string& source, const std::string& options);

/// The file where buildProgram() stores the compiled program: in $XDG_CACHE_HOME/bilayer, else ~/.cache/bilayer; empty
/// if neither variable is set. The name depends on driver, platform, source and options.
std::filesystem::path cachedProgram(const DeviceInfo& device, const std::string& source, const std::string& options);

/// Takes a kernel of a program that no thread uses, or creates one. The first launch of a new kernel takes a
/// millisecond on some GPUs.
cl::Kernel takeKernel(DeviceImpl& device, const cl::Program& program, const char* name);
/// Keeps a kernel for takeKernel().
void keepKernel(DeviceImpl& device, const cl::Program& program, const char* name, cl::Kernel kernel);

}  // namespace bilayer::detail
