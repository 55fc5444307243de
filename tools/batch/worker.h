// SPDX-License-Identifier: Apache-2.0
// Processes that convert one mesh each.
// Tested by tests/tools/batch_limits.cpp through run().
#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstdint>
#include <functional>
#include <string>

namespace bilayer::tools {

/// Limits of one worker; zero: none.
struct WorkerLimits {
    std::chrono::milliseconds time{0};  ///< from its start to its end
    std::uint64_t memory = 0;           ///< memory that it allocates [bytes]
};

/// How a worker ended.
struct WorkerEnd {
    std::string answer;            ///< what its work returned; empty if it failed
    std::string reason;            ///< why it failed: "crash", "time limit", "memory limit"; empty if it did not
    std::string error;             ///< the failure in a sentence without a full stop
    std::uint64_t peakMemory = 0;  ///< peak resident memory [bytes]
};

/// A fork of the calling process that does some work and answers through a pipe. The destructor ends it.
///
/// A fork takes a millisecond, while the program itself takes 40 ms to start: most of the time of a small mesh. The
/// caller must be single-threaded and must not have used TBB; `work` may use both, unlike that of
/// detail::ChildProcess. The child inherits blocked signals, and ends with its parent.
class Worker {
  public:
    using Work = std::function<std::string()>;

    /// Throws std::system_error if no process can be created.
    Worker(const WorkerLimits& limits, const Work& work);
    ~Worker();
    Worker(const Worker&) = delete;
    Worker& operator=(const Worker&) = delete;

    /// A file descriptor that is readable when read() has something to do.
    int pipe() const { return pipe_; }

    /// Reads the part of the answer that has arrived. Returns false if the child has ended.
    bool read();

    /// Milliseconds to the time limit, at least 0; -1 without a limit.
    int millisecondsLeft() const;

    /// Waits for the child's end, and returns how it ended. A child that is still running is ended: its time is up.
    WorkerEnd finish();

  private:
    void closeFiles();
    void describe(WorkerEnd& end, int status) const;

    WorkerLimits limits_;
    std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
    std::string answer_;
    bool hasEnded_ = false;
    int pipe_ = -1;
    int errors_ = -1;  // a file in memory: what the child writes on standard error
    pid_t process_ = -1;
};

}  // namespace bilayer::tools
