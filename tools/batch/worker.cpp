#include "tools/batch/worker.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <signal.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <climits>
#include <exception>
#include <fstream>
#include <new>
#include <system_error>

namespace bilayer::tools {
namespace {

// Exit statuses of a child.
constexpr int answered = 0, outOfMemory = 3, unexpectedEnd = 4;
constexpr std::size_t maxErrorText = 400;  // characters of standard error that a record quotes

// Makes the standard streams those of a process without a terminal.
bool redirectStreams(const std::filesystem::path& errorFile) {
    const int null = ::open("/dev/null", O_RDWR | O_CLOEXEC);
    const int errors = ::open(errorFile.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
    return null >= 0 && errors >= 0 && ::dup2(null, STDIN_FILENO) >= 0 && ::dup2(null, STDOUT_FILENO) >= 0 &&
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

void send(int pipe, std::string_view text) {
    while (!text.empty()) {
        const ssize_t sent = ::write(pipe, text.data(), text.size());
        if (sent < 0 && errno == EINTR) continue;
        if (sent <= 0) ::_exit(unexpectedEnd);
        text.remove_prefix(std::size_t(sent));
    }
}

[[noreturn]] void live(pid_t parent, int pipe, std::uint64_t memory, const std::filesystem::path& errorFile,
                       const Worker::Work& work) noexcept {
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (::getppid() != parent || !redirectStreams(errorFile)) ::_exit(unexpectedEnd);
    limitResources(memory);
    try {
        send(pipe, work());
        ::_exit(answered);
    } catch (const std::bad_alloc&) {
        ::_exit(outOfMemory);
    } catch (const std::exception& error) {
        fmt::print(stderr, "{}\n", error.what());
        ::_exit(unexpectedEnd);
    }
}

// Returns the last line that a child has written on standard error, or nothing.
std::string lastLine(const std::filesystem::path& file) {
    std::ifstream stream(file);
    std::string last;
    for (std::string line; std::getline(stream, line);)
        if (!line.empty()) last = line;
    return last.substr(0, maxErrorText);
}

std::string memoryText(std::uint64_t limit) {
    if (limit == 0) return "the machine's memory is exhausted";
    return fmt::format("needs more than the memory limit of {} MiB", limit >> 20);
}

}  // namespace

Worker::Worker(const WorkerLimits& limits, const std::filesystem::path& errorFile, const Work& work)
    : limits_(limits), errorFile_(errorFile) {
    int ends[2];
    if (::pipe2(ends, O_CLOEXEC) != 0) throw std::system_error(errno, std::generic_category(), "no pipe");
    const pid_t parent = ::getpid();
    process_ = ::fork();
    const int error = errno;
    if (process_ == 0) live(parent, ends[1], limits.memory, errorFile, work);
    ::close(ends[1]);
    pipe_ = ends[0];
    if (process_ > 0) return;
    ::close(pipe_);
    throw std::system_error(error, std::generic_category(), "no process for a mesh");
}

Worker::~Worker() {
    ::close(pipe_);
    if (process_ <= 0) return;
    ::kill(process_, SIGKILL);
    while (::waitpid(process_, nullptr, 0) < 0 && errno == EINTR) {
    }
}

bool Worker::read() {
    char bytes[1 << 12];
    const ssize_t got = ::read(pipe_, bytes, sizeof bytes);
    if (got < 0 && errno == EINTR) return true;
    if (got > 0)
        answer_.append(bytes, std::size_t(got));
    else
        hasEnded_ = true;
    return !hasEnded_;
}

int Worker::millisecondsLeft() const {
    if (limits_.time.count() == 0) return -1;
    const auto left = start_ + limits_.time - std::chrono::steady_clock::now();
    const long long count = std::chrono::ceil<std::chrono::milliseconds>(left).count();
    return int(std::clamp<long long>(count, 0, INT_MAX));
}

WorkerEnd Worker::finish() {
    if (!hasEnded_) ::kill(process_, SIGKILL);
    int status = 0;
    rusage usage{};
    while (::wait4(process_, &status, 0, &usage) < 0 && errno == EINTR) {
    }
    process_ = -1;
    WorkerEnd end;
    end.peakMemory = std::uint64_t(usage.ru_maxrss) * 1024;
    describe(end, status);
    return end;
}

void Worker::describe(WorkerEnd& end, int status) const {
    if (WIFEXITED(status) && WEXITSTATUS(status) == answered && !answer_.empty()) {
        end.answer = answer_;
        return;
    }
    const std::string line = lastLine(errorFile_);
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
