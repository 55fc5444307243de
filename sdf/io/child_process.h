// Work in a process of its own, so that whatever it does to itself, the caller goes on.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstddef>
#include <functional>
#include <stdexcept>

namespace bilayer::detail {

/// What a child process may take before it is ended.
struct ChildLimits {
    std::chrono::milliseconds time;  ///< from its start to the last byte of its answer
    std::size_t memory;              ///< address space beyond what the caller has [bytes]
};

/// A child process did not answer to the end. The text goes on after its subject: "ended by signal 11 ...".
class ChildFailure : public std::runtime_error {
    using std::runtime_error::runtime_error;
};

/// A fork of the calling process that does `work` and answers through a pipe; the destructor ends it.
///
/// Why a fork and no helper program: a library that is linked statically, packed or moved cannot know where a helper of
/// its own stands, and a fork is always there. Only the calling thread goes on in the child. glibc puts its own locks
/// (malloc, stdio, the loader) into order at a fork, so that `work` may allocate and throw; a malloc that replaces
/// glibc's must do so too, as jemalloc and tcmalloc do. `work` must not start threads or use TBB, nor anything else
/// that may hold a lock of its own in another thread of the caller: it would wait for it until its time is over.
///
/// The child has no signal handlers, no files but its pipe and /dev/null, never writes core files, and dies with the
/// thread that made it. It leaves without exit handlers and without flushing the caller's streams. A caller that
/// ignores SIGCHLD, or collects all children by itself, loses nothing but the number of the signal in error texts.
class ChildProcess {
  public:
    /// Sends bytes to the caller.
    using Send = std::function<void(const void* bytes, std::size_t count)>;
    /// An exception that leaves it ends the child without an answer.
    using Work = std::function<void(const Send&)>;

    /// Throws std::system_error when no process can be made.
    ChildProcess(const ChildLimits& limits, const Work& work);
    ~ChildProcess();
    ChildProcess(const ChildProcess&) = delete;
    ChildProcess& operator=(const ChildProcess&) = delete;

    /// The next bytes of the answer. Throws ChildFailure if the child ends before, or its time does.
    void receive(void* bytes, std::size_t count);

  private:
    void waitForBytes();
    [[noreturn]] void throwEnd();

    std::chrono::milliseconds time_;
    std::chrono::steady_clock::time_point deadline_;
    int pipe_ = -1;
    pid_t process_ = -1;
};

}  // namespace bilayer::detail
