// SPDX-License-Identifier: Apache-2.0
// Measures device time by the events of queues.
// Tested by tests/cl/filler.cpp.
#pragma once

#include <algorithm>
#include <cstdint>
#include <mutex>
#include <utility>
#include <vector>

#include <bilayer/cl/filler.h>
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
    OpenclTimes total(std::uint64_t peakBytes) const {
        OpenclTimes times{.peakBytes = peakBytes};
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

/// A sum of times that several threads add to.
class TimesSum {
  public:
    void add(const OpenclTimes& times) {
        const std::lock_guard lock(mutex_);
        sum_ += times;
    }
    OpenclTimes get() const {
        const std::lock_guard lock(mutex_);
        return sum_;
    }

  private:
    mutable std::mutex mutex_;
    OpenclTimes sum_;
};

}  // namespace bilayer::detail
