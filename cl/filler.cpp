// SPDX-License-Identifier: Apache-2.0
#include <bilayer/cl/filler.h>

#include "cl/detail/brick_filler.h"
#include "cl/detail/prism.h"
#include "cl/detail/program.h"
#include "sdf/base/access.h"
#include "sdf/leaf/blocks.h"

namespace bilayer {

using namespace detail;

BlockFiller openclFiller(const Device& device, const OpenclOptions& options) {
    const auto fill = [device, options](const FillJob& job) {
        try {
            return job.options.method == Method::prism ? fillPrism(dataOf(device), options, job)
                                                       : fillByBricks(dataOf(device), options, job);
        } catch (const cl::Error& error) {
            throw deviceError(error, device.info().name);
        }
    };
    return makeOf<BlockFiller>(DeviceFiller{"opencl", device.info().name, fill});
}

}  // namespace bilayer
