// SPDX-License-Identifier: Apache-2.0
// Measures the phases of a build.
// Tested by tests/sdf/build.cpp.
#pragma once

#include <chrono>
#include <utility>

namespace bilayer::detail {

class Stopwatch {
  public:
    /// Returns the seconds since the last call or since construction.
    double lap() {
        const auto now = std::chrono::steady_clock::now();
        return std::chrono::duration<double>(now - std::exchange(last_, now)).count();
    }

  private:
    std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

}  // namespace bilayer::detail
