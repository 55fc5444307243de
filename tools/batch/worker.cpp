// SPDX-License-Identifier: Apache-2.0
#include "tools/batch/worker.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <malloc.h>
#include <poll.h>
#include <signal.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <climits>
#include <exception>
#include <new>
#include <system_error>

#include "sdf/io/child_process.h"
#include "tools/output.h"

namespace bilayer::tools {
namespace {

// Exit statuses of a child.
constexpr int answered = 0, outOfMemory = 3, unexpectedEnd = 4;
constexpr int keptMemory = 1 << 26;  // free memory that a worker keeps for its next task [bytes]
constexpr char reportMark = '+';     // at the beginning of a line that is no answer yet
constexpr off_t maxErrorText = 400;  // characters of standard error that a record quotes

// Makes the standard streams those of a process without a terminal.
bool redirectStreams(int errors) {
    const int null = ::open("/dev/null", O_RDWR | O_CLOEXEC);
    return null >= 0 && ::dup2(null, STDIN_FILENO) >= 0 && ::dup2(null, STDOUT_FILENO) >= 0 &&
           ::dup2(errors, STDERR_FILENO) >= 0;
}

// RLIMIT_DATA counts what is allocated. RLIMIT_AS would also count mapped files and reserved addresses.
void limitResources(std::uint64_t memory) {
    const rlimit none{0, 0};
    ::setrlimit(RLIMIT_CORE, &none);
    if (memory == 0) return;
    const rlimit data{memory, memory};
    ::setrlimit(RLIMIT_DATA, &data);
}

void send(int socket, std::string_view text) {
    while (!text.empty()) {
        const ssize_t sent = ::send(socket, text.data(), text.size(), MSG_NOSIGNAL);
        if (sent < 0 && errno == EINTR) continue;
        if (sent <= 0) ::_exit(unexpectedEnd);
        text.remove_prefix(std::size_t(sent));
    }
}

// Makes the peak of resident memory that of the next task, where the kernel allows it.
void resetPeakMemory() {
    detail::ChildProcess::resetPeakMemory();
    const int file = ::open("/proc/self/clear_refs", O_WRONLY | O_CLOEXEC);
    if (file < 0) return;
    [[maybe_unused]] const ssize_t written = ::write(file, "5", 1);
    ::close(file);
}

// Pages that the kernel takes back have to be filled again by the next task. That takes longer than a small build.
void keepFreeMemory() {
    ::mallopt(M_MMAP_THRESHOLD, keptMemory / 2);
    ::mallopt(M_TRIM_THRESHOLD, keptMemory);
    ::mallopt(M_TOP_PAD, keptMemory / 4);
}

void serve(int socket, const Worker::Work& work) {
    keepFreeMemory();
    WorkerTask task;
    while (::recv(socket, &task, sizeof task, MSG_WAITALL) == ssize_t(sizeof task)) {
        resetPeakMemory();
        const std::string answer =
            work(task, [socket](const std::string& text) { send(socket, fmt::format("{}{}\n", reportMark, text)); });
        send(socket, fmt::format("{} {}\n", peakMemory(), answer));
    }
}

[[noreturn]] void live(pid_t parent, int socket, int errors, std::uint64_t memory, const Worker::Work& work) noexcept {
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (::getppid() != parent || !redirectStreams(errors)) ::_exit(unexpectedEnd);
    limitResources(memory);
    try {
        serve(socket, work);
        ::_exit(answered);
    } catch (const std::bad_alloc&) {
        ::_exit(outOfMemory);
    } catch (const std::exception& error) {
        fmt::print(stderr, "{}\n", error.what());
        ::_exit(unexpectedEnd);
    }
}

// Returns the last line that a child has written on standard error, or nothing.
std::string lastLine(int errors) {
    const off_t size = ::lseek(errors, 0, SEEK_END);
    std::string text(std::size_t(std::clamp<off_t>(size, 0, maxErrorText)), '\0');
    const ssize_t got = ::pread(errors, text.data(), text.size(), size - off_t(text.size()));
    text.resize(std::size_t(std::max<ssize_t>(got, 0)));
    text.erase(text.find_last_not_of('\n') + 1);
    return text.substr(text.find_last_of('\n') + 1);
}

std::string memoryText(std::uint64_t limit) {
    if (limit == 0) return "the machine's memory is exhausted";
    return fmt::format("needs more than the memory limit of {} MiB", limit >> 20);
}

}  // namespace

Worker::Worker(const WorkerLimits& limits, const Work& work) : limits_(limits) {
    int ends[2];
    if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0)
        throw std::system_error(errno, std::generic_category(), "no socket");
    socket_ = ends[0];
    errors_ = ::memfd_create("stderr", MFD_CLOEXEC);
    const pid_t parent = ::getpid();
    if (errors_ >= 0) process_ = ::fork();
    const int error = errno;
    if (process_ == 0) {
        ::close(ends[0]);
        live(parent, ends[1], errors_, limits.memory, work);
    }
    ::close(ends[1]);
    if (process_ > 0) return;
    closeFiles();
    throw std::system_error(error, std::generic_category(), "no process for a mesh");
}

Worker::~Worker() {
    closeFiles();
    if (process_ <= 0) return;
    ::kill(process_, SIGKILL);
    while (::waitpid(process_, nullptr, 0) < 0 && errno == EINTR) {
    }
}

void Worker::closeFiles() {
    ::close(socket_);
    if (errors_ >= 0) ::close(errors_);
}

void Worker::begin(const WorkerTask& task) {
    ++begun_;
    start_ = std::chrono::steady_clock::now();
    answer_.clear();
    reported_.clear();
    // the child's standard error has the same offset
    if (::ftruncate(errors_, 0) == 0) ::lseek(errors_, 0, SEEK_SET);
    // a child that has ended is noticed when it is read
    ::send(socket_, &task, sizeof task, MSG_NOSIGNAL);
}

bool Worker::read() {
    char bytes[1 << 12];
    const ssize_t got = ::read(socket_, bytes, sizeof bytes);
    if (got < 0 && errno == EINTR) return true;
    if (got > 0)
        answer_.append(bytes, std::size_t(got));
    else
        hasEnded_ = true;
    for (std::size_t end; answer_.starts_with(reportMark) && (end = answer_.find('\n')) != std::string::npos;) {
        reported_ = answer_.substr(1, end - 1);
        answer_.erase(0, end + 1);
    }
    return !hasEnded_ && !answer_.ends_with('\n');
}

int Worker::millisecondsLeft() const {
    if (limits_.time.count() == 0) return -1;
    const auto left = start_ + limits_.time - std::chrono::steady_clock::now();
    const long long count = std::chrono::ceil<std::chrono::milliseconds>(left).count();
    return int(std::clamp<long long>(count, 0, INT_MAX));
}

WorkerEnd Worker::finish() {
    WorkerEnd end;
    if (answer_.ends_with('\n')) {
        const std::size_t space = answer_.find(' ');
        end.peakMemory = std::stoull(answer_);
        end.answer = answer_.substr(space + 1, answer_.size() - space - 2);
        return end;
    }
    if (!hasEnded_) ::kill(process_, SIGKILL);
    int status = 0;
    rusage usage{};
    while (::wait4(process_, &status, 0, &usage) < 0 && errno == EINTR) {
    }
    process_ = -1;
    end.reported = reported_;
    end.peakMemory = std::uint64_t(usage.ru_maxrss) * 1024;
    describeFailure(end, status);
    return end;
}

void Worker::describeFailure(WorkerEnd& end, int status) const {
    const std::string line = lastLine(errors_);
    const std::string detail = line.empty() ? "" : ": " + line;
    const bool isOutOfMemory =
        WIFEXITED(status) ? WEXITSTATUS(status) == outOfMemory : line.find("std::bad_alloc") != std::string::npos;
    if (!hasEnded_) {
        end.reason = "time limit";
        end.error = fmt::format("took longer than the time limit of {} s", double(limits_.time.count()) / 1000);
    } else if (isOutOfMemory) {
        end.reason = "memory limit";
        end.error = memoryText(limits_.memory);
    } else if (WIFSIGNALED(status)) {
        end.reason = "crash";
        end.error = fmt::format("ended by signal {} ({}){}", WTERMSIG(status), ::strsignal(WTERMSIG(status)),
                                WTERMSIG(status) == SIGKILL ? ": out of memory, or ended by another program" : detail);
    } else {
        end.reason = "crash";
        end.error = fmt::format("ended with status {}{}", WEXITSTATUS(status), detail);
    }
}

}  // namespace bilayer::tools
