// SPDX-License-Identifier: Apache-2.0
// Waits for the commands of a queue at the end of a scope.
// Tested by tests/cl/filler.cpp.
#pragma once

#include "cl/detail/program.h"

namespace bilayer::detail {

/// Scope guard: its destructor waits until the commands of a queue have ended, also after an error. The commands use
/// memory of the enclosing scope. As a class member it must be declared last, so that it is destroyed first.
class QueueGuard {
  public:
    explicit QueueGuard(const cl::CommandQueue& queue) : queue_(queue) {}
    QueueGuard(const QueueGuard&) = delete;
    QueueGuard& operator=(const QueueGuard&) = delete;
    ~QueueGuard() {
        if (queue_()) ::clFinish(queue_());
    }

  private:
    const cl::CommandQueue& queue_;
};

}  // namespace bilayer::detail
