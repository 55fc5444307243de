// SPDX-License-Identifier: Apache-2.0
// Signals that end a batch, as something to wait for.
// Tested by tests/tools/batch_limits.cpp through the program.
#pragma once

#include <signal.h>

namespace bilayer::tools {

/// Blocks SIGINT, SIGTERM and SIGHUP during its lifetime, in this process and in the children that it creates. Ignored
/// signals stay ignored.
class SignalWatch {
  public:
    /// Throws std::system_error.
    SignalWatch();
    ~SignalWatch();
    SignalWatch(const SignalWatch&) = delete;
    SignalWatch& operator=(const SignalWatch&) = delete;

    int file() const { return file_; }  ///< readable when a signal has arrived
    int arrived() const;                ///< the next signal that has arrived, or 0

  private:
    sigset_t before_;
    int file_ = -1;
};

}  // namespace bilayer::tools
