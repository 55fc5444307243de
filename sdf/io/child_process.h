// SPDX-License-Identifier: Apache-2.0
// Runs work in a child process, so that a crash or hang does not affect the caller.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <stdexcept>

namespace bilayer::detail {

/// Limits beyond which a child process is ended.
struct ChildLimits {
    std::chrono::milliseconds time;  ///< from the start to the last byte of the answer
    std::size_t memory;              ///< address space in addition to the caller's [bytes]
};

/// Thrown if a child process did not complete its answer. The text continues a sentence whose subject precedes it:
/// "ended by signal 11 ...".
class ChildFailure : public std::runtime_error {
    using std::runtime_error::runtime_error;
};

/// A fork of the calling process that runs `work` and answers through a pipe. The destructor ends it.
///
/// A fork is always available. A helper program is not: a library that is linked statically, packed or moved cannot
/// locate one. Only the calling thread continues in the child. glibc resets its own locks (malloc, stdio, the loader)
/// at a fork, so `work` may allocate and throw. A malloc that replaces glibc's must do so too, as jemalloc and tcmalloc
/// do. `work` must not start threads or use TBB, nor take any lock that another thread of the caller may hold: it would
/// wait until its time limit. The lock for exit handlers is an exception: C++ takes it for each static object with a
/// destructor, in the libraries of the caller and of `work`, and glibc keeps it locked in a child that was forked in
/// that moment. The child takes it first, and is started again if it cannot.
///
/// The child has no signal handlers, no files except its pipe and /dev/null, never writes core files, and ends with the
/// thread that created it. It exits without exit handlers and without flushing the caller's streams. If a caller
/// ignores SIGCHLD or reaps all children itself, error texts lack the signal number; nothing else changes.
class ChildProcess {
  public:
    /// The maximum peak of resident memory of the children that have ended since the last reset [bytes].
    static std::uint64_t peakMemory();
    static void resetPeakMemory();

    /// Sends bytes to the caller.
    using Send = std::function<void(const void* bytes, std::size_t count)>;
    /// Receives bytes that were sent. Throws ChildFailure if there are fewer.
    using Receive = std::function<void(void* bytes, std::size_t count)>;
    /// An exception from this function ends the child without an answer.
    using Work = std::function<void(const Send&)>;

    /// Returns when the child has started. Throws std::system_error if no process can be created, and ChildFailure if
    /// the child does not start within the time limit.
    ChildProcess(const ChildLimits& limits, const Work& work);
    ~ChildProcess();
    ChildProcess(const ChildProcess&) = delete;
    ChildProcess& operator=(const ChildProcess&) = delete;

    /// Receives the next bytes of the answer. Throws ChildFailure if the child ends or times out before that.
    void receive(void* bytes, std::size_t count);

  private:
    void start(std::chrono::milliseconds startTime, std::size_t addressLimit, const Work& work);
    bool hasStarted();
    void end() noexcept;
    pid_t reap(int* status, int options) noexcept;
    std::size_t receiveSome(char* bytes, std::size_t count);  // 0: the child closed the pipe
    void waitForBytes();
    [[noreturn]] void throwEnd();

    std::chrono::milliseconds time_;
    std::chrono::steady_clock::time_point deadline_;
    int pipe_ = -1;
    pid_t process_ = -1;
};

}  // namespace bilayer::detail
