// SPDX-License-Identifier: Apache-2.0
// The progress of a batch on a terminal.
// Tested by tests/tools/batch.cpp through the program.
#pragma once

#include <chrono>
#include <cstddef>

namespace bilayer::tools {

/// Counts of meshes.
struct BatchCounts {
    std::size_t total = 0, done = 0, skipped = 0, failed = 0;
    std::size_t finished() const { return done + skipped + failed; }
};

/// A line on stderr, if stderr is a terminal: finished, failed, rate, time left. It disappears at the end.
class ProgressLine {
  public:
    ProgressLine();
    ~ProgressLine();
    ProgressLine(const ProgressLine&) = delete;
    ProgressLine& operator=(const ProgressLine&) = delete;

    /// Draws the line, at most ten times a second.
    void show(const BatchCounts& counts);

  private:
    using Clock = std::chrono::steady_clock;

    bool visible_;
    Clock::time_point start_ = Clock::now(), drawn_{};
};

}  // namespace bilayer::tools
