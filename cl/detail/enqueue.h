// SPDX-License-Identifier: Apache-2.0
// Enqueues kernels by name.
// Tested by tests/cl/filler.cpp through openclFiller().
#pragma once

#include <utility>

#include "cl/detail/program.h"

namespace bilayer::detail {

/// Enqueues a kernel of a program with its arguments in order.
/// @param event  if not null, receives the event of the kernel
template <class... Arguments>
void enqueueKernel(DeviceImpl& device, const cl::CommandQueue& queue, const cl::Program& program, const char* name,
                   const cl::NDRange& global, const cl::NDRange& local, cl::Event* event,
                   const Arguments&... arguments) {
    cl::Kernel kernel = takeKernel(device, program, name);
    cl_uint index = 0;
    (kernel.setArg(index++, arguments), ...);
    queue.enqueueNDRangeKernel(kernel, cl::NullRange, global, local, nullptr, event);
    keepKernel(device, program, name, std::move(kernel));
}

}  // namespace bilayer::detail
