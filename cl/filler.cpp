// SPDX-License-Identifier: Apache-2.0
#include <bilayer/cl/filler.h>

#include <memory>

#include "cl/detail/brick_filler.h"
#include "cl/detail/prism.h"
#include "cl/detail/program.h"
#include "cl/detail/timing.h"

namespace bilayer {

using namespace detail;

OpenclFiller openclFiller(const Device& device, const OpenclOptions& options) {
    const auto sum = std::make_shared<TimesSum>();
    const auto fill = [device, options, sum](const FillJob& job) {
        try {
            sum->add(job.options.method == Method::prism ? fillPrism(device.impl(), options, job)
                                                         : fillByBricks(device.impl(), options, job));
        } catch (const cl::Error& error) {
            throw deviceError(error, device.info().name);
        }
    };
    return {{"opencl", device.info().name, fill}, [sum] { return sum->get(); }};
}

}  // namespace bilayer
