// SPDX-License-Identifier: Apache-2.0
// Measures time in seconds.
// Tested by tests/sdf/build.cpp through build().
#pragma once

#include <chrono>

namespace bilayer::detail {

class Stopwatch {
  public:
    /// Returns the seconds since the last lap or since construction.
    double seconds() const { return since(Clock::now()); }
    /// The same, and begins a lap.
    double lap() {
        const Clock::time_point now = Clock::now();
        const double passed = since(now);
        last_ = now;
        return passed;
    }

  private:
    using Clock = std::chrono::steady_clock;
    double since(Clock::time_point now) const { return std::chrono::duration<double>(now - last_).count(); }

    Clock::time_point last_ = Clock::now();
};

}  // namespace bilayer::detail
