// Measures the device time of a build by the events of its queues.
// Tested by tests/cl/filler.cpp.
#pragma once

#include <algorithm>
#include <utility>
#include <vector>

#include <bilayer/cl/filler.h>
#include "cl/detail/program.h"

namespace bilayer::detail {

/// Collects the events of one build.
class Timing {
  public:
    enum class Of { kernel, upload, download };

    /// @param times  receives the sums; null: no event is kept
    explicit Timing(OpenclTimes* times) : times_(times) {}

    /// Storage for a command's event; null if times are not measured.
    cl::Event* event(Of what) {
        if (!times_) return nullptr;
        events_.emplace_back(what, cl::Event());
        return &events_.back().second;
    }
    void keep(Of what, const cl::Event& event) {
        if (times_) events_.emplace_back(what, event);
    }

    /// Adds up all events so far. Overlapping kernels count once. Call it when the commands have ended.
    void sumUp() {
        std::vector<std::pair<cl_ulong, cl_ulong>> kernels;
        for (const auto& [what, event] : events_) {
            if (!event()) continue;  // nothing was copied: host and device share the memory
            const auto begin = event.getProfilingInfo<CL_PROFILING_COMMAND_START>(),
                       end = event.getProfilingInfo<CL_PROFILING_COMMAND_END>();
            if (what == Of::kernel)
                kernels.emplace_back(begin, end);
            else
                (what == Of::upload ? times_->upload : times_->download) += 1e-9 * double(end - begin);
        }
        events_.clear();
        std::sort(kernels.begin(), kernels.end());
        cl_ulong until = 0;
        for (const auto& [begin, end] : kernels) {
            if (end > until) times_->kernels += 1e-9 * double(end - std::max(begin, until));
            until = std::max(until, end);
        }
    }

  private:
    OpenclTimes* times_;
    std::vector<std::pair<Of, cl::Event>> events_;
};

}  // namespace bilayer::detail
