// SPDX-License-Identifier: Apache-2.0
// Processes that convert meshes, one after the other.
// Tested by tests/tools/batch_limits.cpp through the program.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstdint>
#include <functional>
#include <string>

namespace bilayer::tools {

/// Limits of one task; zero: none.
struct WorkerLimits {
    std::chrono::milliseconds time{0};  ///< from its start to its end
    std::uint64_t memory = 0;           ///< memory that its process allocates [bytes]
};

/// What a worker is to do.
struct WorkerTask {
    std::size_t mesh = 0;  ///< index into the meshes of the batch
    int threads = 1;
    bool isLarge = false;
};

/// How a task ended.
struct WorkerEnd {
    std::string answer;            ///< what the work returned; empty if it failed
    std::string reported;          ///< what it reported last before it failed
    std::string reason;            ///< why it failed: "crash", "time limit", "memory limit"; empty if it did not
    std::string error;             ///< the failure in a sentence without a full stop
    std::uint64_t peakMemory = 0;  ///< peak resident memory [bytes]
};

/// A fork of the calling process that does tasks, one after the other. The destructor ends it.
///
/// A fork and its first use of memory take some ten milliseconds, most of the time of a small mesh. The caller must be
/// single-threaded and must not have used TBB; `work` may use both, unlike that of detail::ChildProcess. The child
/// inherits blocked signals, and ends with its parent.
class Worker {
  public:
    /// Keeps a text without line breaks, in case that the process ends before it answers.
    using Report = std::function<void(const std::string&)>;
    /// Returns an answer of at least one character, without line breaks.
    using Work = std::function<std::string(const WorkerTask&, const Report&)>;

    /// Throws std::system_error if no process can be created.
    Worker(const WorkerLimits& limits, const Work& work);
    ~Worker();
    Worker(const Worker&) = delete;
    Worker& operator=(const Worker&) = delete;

    /// Begins a task; the one before must have ended with an answer.
    void begin(const WorkerTask& task);

    /// A file descriptor that is readable when read() has something to do.
    int socket() const { return socket_; }

    /// Reads the part of the answer that has arrived. Returns false if the answer is complete or the process has ended.
    bool read();

    /// Milliseconds to the time limit, at least 0; -1 without a limit.
    int millisecondsLeft() const;

    /// Returns how the task ended. Without an answer the process has ended, or is ended: its time is up.
    WorkerEnd finish();

    /// Whether it has done a task before the one that it does.
    bool isUsed() const { return begun_ > 1; }

  private:
    void closeFiles();
    void describeFailure(WorkerEnd& end, int status) const;

    WorkerLimits limits_;
    std::chrono::steady_clock::time_point start_;  // of the task
    std::string answer_, reported_;
    bool hasEnded_ = false;
    int begun_ = 0;    // tasks
    int socket_ = -1;  // to the child: tasks there, lines of answers back
    int errors_ = -1;  // a file in memory: what the child writes on standard error
    pid_t process_ = -1;
};

}  // namespace bilayer::tools
