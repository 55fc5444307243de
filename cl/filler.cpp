#include <bilayer/cl/filler.h>

#include "cl/detail/brick_filler.h"
#include "cl/detail/prism.h"
#include "cl/detail/program.h"

namespace bilayer {

using namespace detail;

BlockFiller openclFiller(const Device& device, const OpenclOptions& options) {
    return {"opencl", device.info().name, [device, options](const FillJob& job) {
                try {
                    if (job.options.method == Method::prism) return fillPrism(device.impl(), options, job);
                    fillByBricks(device.impl(), options, job);
                } catch (const cl::Error& error) {
                    throw deviceError(error, device.info().name);
                }
            }};
}

}  // namespace bilayer
