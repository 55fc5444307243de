// SPDX-License-Identifier: Apache-2.0
// Measures device time by the events of queues.
// Tested by tests/cl/filler.cpp through openclFiller().
#pragma once

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include <bilayer/sdf/level_set.h>
#include "cl/detail/program.h"

namespace bilayer::detail {

/// Collects the events of one call, for example of a build.
class Timing {
  public:
    enum class Command { kernel, upload, download };

    /// @param profile  false: no event is kept, and the times are zero
    explicit Timing(bool profile) : profile_(profile) {}

    /// Storage for a command's event; null if times are not measured.
    cl::Event* event(Command command) {
        if (!profile_) return nullptr;
        events_.emplace_back(command, cl::Event());
        return &events_.back().second;
    }
    void keep(Command command, const cl::Event& event) {
        if (profile_) events_.emplace_back(command, event);
    }

    /// The sum over all events so far. Overlapping kernels count once. Call it when the commands have ended.
    DeviceTimes total(std::uint64_t peakBytes) const {
        DeviceTimes times{.peakBytes = peakBytes};
        std::vector<std::pair<cl_ulong, cl_ulong>> kernels;
        for (const auto& [command, event] : events_) {
            if (!event()) continue;  // nothing was copied: host and device share the memory
            const auto begin = event.getProfilingInfo<CL_PROFILING_COMMAND_START>(),
                       end = event.getProfilingInfo<CL_PROFILING_COMMAND_END>();
            if (command == Command::kernel)
                kernels.emplace_back(begin, end);
            else
                (command == Command::upload ? times.upload : times.download) += 1e-9 * double(end - begin);
        }
        std::sort(kernels.begin(), kernels.end());
        cl_ulong until = 0;
        for (const auto& [begin, end] : kernels) {
            if (end > until) times.kernels += 1e-9 * double(end - std::max(begin, until));
            until = std::max(until, end);
        }
        return times;
    }

  private:
    bool profile_;
    std::vector<std::pair<Command, cl::Event>> events_;
};

}  // namespace bilayer::detail
