// SPDX-License-Identifier: Apache-2.0
#include "integration/python/cancellable.h"

#include <cxxabi.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <exception>
#include <future>
#include <memory>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include <bilayer/sdf/options.h>

#include "integration/python/convert.h"
#include "integration/python/without_gil.h"

namespace bilayer::python {
namespace {

using Clock = std::chrono::steady_clock;

/// How often a job's caller looks for signals and reports progress.
constexpr std::chrono::milliseconds pollInterval(20);
/// Rounds of a batch grow by this factor at most: items may take longer than those before them.
constexpr double maxGrowth = 16;
/// Parts for each core, so that none waits long for the last.
constexpr std::size_t partsPerCore = 8;
/// A part has no more groups than this.
constexpr std::size_t maxGroups = 16;

/// A thread that runs one job after another.
class Worker {
  public:
    Worker() : thread_([this] { run(); }) { thread_.detach(); }

    std::future<void> start(std::function<void()> job) {
        std::packaged_task<void()> task(std::move(job));
        std::future<void> done = task.get_future();
        {
            const std::lock_guard lock(mutex_);
            task_ = std::move(task);
        }
        wake_.notify_one();
        return done;
    }

  private:
    [[noreturn]] void run() {
        std::unique_lock lock(mutex_);
        for (;;) {
            wake_.wait(lock, [&] { return task_.valid(); });
            std::packaged_task<void()> task = std::exchange(task_, {});
            lock.unlock();
            task();
            lock.lock();
        }
    }

    std::mutex mutex_;
    std::condition_variable wake_;
    std::packaged_task<void()> task_;
    std::thread thread_;  // starts last
};

/// Workers that wait for jobs. They are kept, since TBB 2021.8 keeps 8 KB of each thread that has used it.
class Workers {
  public:
    /// Lives as long as the process, as its workers do.
    static Workers& all() {
        static Workers* const workers = new Workers;
        return *workers;
    }

    std::unique_ptr<Worker> take() {
        const std::lock_guard lock(mutex_);
        // threads are not in the copy of a process that fork() makes
        if (std::exchange(process_, ::getpid()) != ::getpid())
            for (auto& worker : std::exchange(idle_, {})) static_cast<void>(worker.release());
        if (idle_.empty()) return std::make_unique<Worker>();
        std::unique_ptr<Worker> worker = std::move(idle_.back());
        idle_.pop_back();
        return worker;
    }
    void giveBack(std::unique_ptr<Worker> worker) {
        const std::lock_guard lock(mutex_);
        idle_.push_back(std::move(worker));
    }

  private:
    std::mutex mutex_;
    std::vector<std::unique_ptr<Worker>> idle_;
    pid_t process_ = ::getpid();
};

void throwIfSignalled() {
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
}

// Calls `progress` with the fraction. Returns false if it returned False.
bool report(const py::object& progress, float fraction) {
    if (progress.is_none()) return true;
    const py::object answer = progress(fraction);
    if (answer.is_none()) return true;
    const bool isFlag = py::detail::make_caster<bool>().load(answer, /*convert=*/false);  // of Python or numpy
    if (!isFlag) refuseType("progress", "it to return True, False or None", answer);
    return answer.cast<bool>();
}

}  // namespace

void runCancellable(const py::object& progress, const std::function<void(const ProgressCallback&)>& job) {
    std::atomic<float> fraction = 0;
    std::atomic<bool> cancelled = false;
    std::exception_ptr raised;
    const ProgressCallback progressCallback = [&](float done) {
        fraction = done;
        return !cancelled;
    };
    std::unique_ptr<Worker> worker = Workers::all().take();
    std::future<void> running = worker->start([&] { job(progressCallback); });
    const auto finished = [&] {
        const WithoutGil release;
        return running.wait_for(pollInterval) == std::future_status::ready;
    };
    while (!finished()) {
        if (cancelled) continue;
        try {
            throwIfSignalled();
            if (!report(progress, fraction)) cancelled = true;
        } catch (abi::__forced_unwind&) {
            waitForExit();
        } catch (...) {
            raised = std::current_exception();
            cancelled = true;
        }
    }
    try {
        running.get();
    } catch (...) {
        if (!raised) raised = std::current_exception();
    }
    Workers::all().giveBack(std::move(worker));
    if (raised) std::rethrow_exception(raised);
    if (cancelled || !report(progress, 1)) throw Cancelled();  // requested in the last moment
}

void answerInParts(std::size_t count, std::size_t group,
                   const std::function<void(std::size_t begin, std::size_t end)>& answer) {
    const auto cores = std::size_t(tbb::this_task_arena::max_concurrency());
    std::size_t round = group;  // items between two looks for signals
    for (std::size_t begin = 0; begin < count;) {
        const std::size_t end = begin + std::min(round, count - begin);
        const std::size_t part =
            std::clamp((end - begin) / (partsPerCore * cores) / group, std::size_t(1), maxGroups) * group;
        const Clock::time_point start = Clock::now();
        {
            const WithoutGil release;
            if (end - begin <= part)
                answer(begin, end);
            else
                tbb::parallel_for(begin, end, part, [&](std::size_t i) { answer(i, std::min(i + part, end)); });
        }
        if (end < count) throwIfSignalled();
        const std::chrono::duration<double> took = Clock::now() - start;
        const double growth = std::min(std::chrono::duration<double>(pollInterval) / took, maxGrowth);
        round = std::max<std::size_t>(std::size_t(double(round) * growth) / group, 1) * group;
        begin = end;
    }
}

}  // namespace bilayer::python
