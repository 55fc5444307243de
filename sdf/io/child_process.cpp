// SPDX-License-Identifier: Apache-2.0
#include "sdf/io/child_process.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <signal.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/time.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <climits>
#include <cstdlib>
#include <exception>
#include <fstream>
#include <new>
#include <system_error>

namespace bilayer::detail {
namespace {

constexpr int answerPipe = 3;                 // file descriptor in the child: the first after the standard streams
constexpr int pipeCapacity = 1 << 20;         // [bytes]: needs fewer context switches than the usual 64 kB
constexpr int diedBeforeAnswer = 127;         // exit status
constexpr char startMark = 's';               // the child's first byte
std::atomic<std::uint64_t> childrenPeak = 0;  // [bytes]
constexpr std::chrono::milliseconds firstStartTime{20}, maxStartTime{10000};

// Blocks signals until the child has removed the caller's handlers.
class SignalsBlocked {
  public:
    SignalsBlocked() {
        sigset_t all;
        sigfillset(&all);
        pthread_sigmask(SIG_SETMASK, &all, &before_);
    }
    ~SignalsBlocked() { pthread_sigmask(SIG_SETMASK, &before_, nullptr); }
    SignalsBlocked(const SignalsBlocked&) = delete;
    SignalsBlocked& operator=(const SignalsBlocked&) = delete;

  private:
    sigset_t before_;
};

// Returns the address space of this process [bytes].
std::size_t addressSpace() {
    std::size_t pages = 0;
    std::ifstream("/proc/self/statm") >> pages;
    return pages * std::size_t(::sysconf(_SC_PAGESIZE));
}

// Makes any exit of the child immediate, without the exit and terminate handlers of the caller.
void takeDefaultEnds() {
    std::atexit([] { ::_exit(diedBeforeAnswer); });  // runs before handlers that were registered earlier
    std::set_terminate(std::abort);
    std::set_new_handler(nullptr);
}

void takeDefaultSignals() {
    struct sigaction byDefault {};
    byDefault.sa_handler = SIG_DFL;
    for (int signal = 1; signal < NSIG; ++signal) ::sigaction(signal, &byDefault, nullptr);
    sigset_t none;
    sigemptyset(&none);
    pthread_sigmask(SIG_SETMASK, &none, nullptr);
}

// Keeps only the pipe, as `answerPipe`, and /dev/null as the standard streams. The pipe may have any descriptor.
bool keepOnly(int pipe) {
    const int moved = ::fcntl(pipe, F_DUPFD, answerPipe + 1);
    const int null = ::open("/dev/null", O_RDWR);
    if (moved < 0 || null < 0) return false;
    for (int stream = 0; stream < answerPipe; ++stream)
        if (::dup2(null, stream) < 0) return false;
    if (::dup2(moved, answerPipe) < 0) return false;
    if (::close_range(answerPipe + 1, UINT_MAX, 0) == 0) return true;
    const long last = ::sysconf(_SC_OPEN_MAX);  // for kernels before 5.9
    for (int file = answerPipe + 1; file < last; ++file) ::close(file);
    return true;
}

void send(const void* bytes, std::size_t count) {
    const char* from = static_cast<const char*>(bytes);
    while (count > 0) {
        const ssize_t sent = ::write(answerPipe, from, count);
        if (sent < 0 && errno == EINTR) continue;
        if (sent <= 0) ::_exit(diedBeforeAnswer);
        from += sent;
        count -= std::size_t(sent);
    }
}

// Ends this process by SIGALRM after `time`; zero: never.
void setAlarm(std::chrono::microseconds time) {
    const itimerval once{{0, 0}, {time.count() / 1000000, time.count() % 1000000}};
    ::setitimer(ITIMER_REAL, &once, nullptr);
}

[[noreturn]] void live(int pipe, std::chrono::milliseconds startTime, std::size_t addressLimit,
                       const ChildProcess::Work& work) noexcept {
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    ::prctl(PR_SET_DUMPABLE, 0);
    takeDefaultSignals();
    setAlarm(startTime);
    takeDefaultEnds();  // waits for ever if another thread of the caller was registering an exit handler at the fork
    setAlarm({});
    const rlimit memory{addressLimit, addressLimit};
    ::setrlimit(RLIMIT_AS, &memory);
    if (keepOnly(pipe)) try {
            send(&startMark, 1);
            work(send);
            ::_exit(0);
        } catch (...) {
        }
    ::_exit(diedBeforeAnswer);
}

}  // namespace

ChildProcess::ChildProcess(const ChildLimits& limits, const Work& work)
    : time_(limits.time), deadline_(std::chrono::steady_clock::now() + limits.time) {
    const std::size_t addressLimit = addressSpace() + limits.memory;
    try {
        for (auto startTime = firstStartTime;; startTime *= 2) {
            start(startTime, addressLimit, work);
            if (hasStarted()) return;
            end();
            if (startTime > maxStartTime) throw ChildFailure("did not start");
        }
    } catch (...) {
        end();
        throw;
    }
}

ChildProcess::~ChildProcess() {
    end();
}

void ChildProcess::start(std::chrono::milliseconds startTime, std::size_t addressLimit, const Work& work) {
    int ends[2];
    if (::pipe2(ends, O_CLOEXEC) != 0) throw std::system_error(errno, std::generic_category(), "no pipe");
    ::fcntl(ends[1], F_SETPIPE_SZ, pipeCapacity);  // best effort: the system may allow less
    pipe_ = ends[0];
    int error = 0;
    {
        const SignalsBlocked blocked;
        process_ = ::fork();
        error = errno;
        if (process_ == 0) live(ends[1], startTime, addressLimit, work);
    }
    ::close(ends[1]);
    if (process_ < 0) throw std::system_error(error, std::generic_category(), "no child process");
}

bool ChildProcess::hasStarted() {
    char mark = 0;
    return receiveSome(&mark, 1) == 1 && mark == startMark;
}

void ChildProcess::end() noexcept {
    if (pipe_ >= 0) ::close(pipe_);
    pipe_ = -1;
    if (process_ <= 0) return;
    // Until the child is reaped, here or by the caller's own handler, its process id stays valid.
    if (reap(nullptr, WNOHANG) == 0) {
        ::kill(process_, SIGKILL);
        reap(nullptr, 0);
    }
    process_ = -1;
}

pid_t ChildProcess::reap(int* status, int options) noexcept {
    rusage usage{};
    pid_t ended = 0;
    while ((ended = ::wait4(process_, status, options, &usage)) < 0 && errno == EINTR) {
    }
    const auto peak = std::uint64_t(usage.ru_maxrss) * 1024;
    for (std::uint64_t known = childrenPeak; peak > known && !childrenPeak.compare_exchange_weak(known, peak);) {
    }
    return ended;
}

std::uint64_t ChildProcess::peakMemory() {
    return childrenPeak;
}

void ChildProcess::resetPeakMemory() {
    childrenPeak = 0;
}

void ChildProcess::receive(void* bytes, std::size_t count) {
    char* to = static_cast<char*>(bytes);
    while (count > 0) {
        const std::size_t got = receiveSome(to, count);
        if (got == 0) throwEnd();
        to += got;
        count -= got;
    }
}

std::size_t ChildProcess::receiveSome(char* bytes, std::size_t count) {
    for (;;) {
        waitForBytes();
        const ssize_t got = ::read(pipe_, bytes, count);
        if (got < 0 && errno == EINTR) continue;
        return std::size_t(std::max<ssize_t>(got, 0));
    }
}

void ChildProcess::waitForBytes() {
    using std::chrono::milliseconds;
    for (;;) {
        const auto left = std::chrono::ceil<milliseconds>(deadline_ - std::chrono::steady_clock::now()).count();
        if (left <= 0) throw ChildFailure(fmt::format("took longer than {} s", double(time_.count()) / 1000));
        pollfd end{pipe_, POLLIN, 0};
        const int ready = ::poll(&end, 1, int(std::min<long long>(left, INT_MAX)));
        if (ready > 0) return;
        if (ready < 0 && errno != EINTR) throw std::system_error(errno, std::generic_category(), "poll");
    }
}

void ChildProcess::throwEnd() {
    int status = 0;
    const pid_t ended = reap(&status, 0);
    process_ = -1;
    if (ended > 0 && WIFSIGNALED(status))
        throw ChildFailure(fmt::format("ended by signal {} ({})", WTERMSIG(status), ::strsignal(WTERMSIG(status))));
    throw ChildFailure("ended without an answer");
}

}  // namespace bilayer::detail
