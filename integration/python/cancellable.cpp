// SPDX-License-Identifier: Apache-2.0
#include "integration/python/cancellable.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <exception>
#include <future>

#include <bilayer/sdf/options.h>

#include "integration/python/convert.h"

namespace bilayer::python {
namespace {

using Clock = std::chrono::steady_clock;

/// How often a job's caller looks for signals and reports progress.
constexpr std::chrono::milliseconds pollInterval(20);
/// Parts of a batch that are answered before the first look for signals.
constexpr std::size_t firstParts = 16;

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

void runCancellable(const py::object& progress, const std::function<void(const Listener&)>& job) {
    std::atomic<float> fraction = 0;
    std::atomic<bool> cancelled = false;
    std::exception_ptr raised;
    const Listener listener = [&](float done) {
        fraction = done;
        return !cancelled;
    };
    auto running = std::async(std::launch::async, [&] { job(listener); });
    const auto finished = [&] {
        const py::gil_scoped_release release;
        return running.wait_for(pollInterval) == std::future_status::ready;
    };
    while (!finished()) {
        if (cancelled) continue;
        try {
            throwIfSignalled();
            if (!report(progress, fraction)) cancelled = true;
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
    if (!raised && cancelled) raised = std::make_exception_ptr(Cancelled());  // requested in the last moment
    if (raised) std::rethrow_exception(raised);
    report(progress, 1);
}

void answerInParts(std::size_t count, std::size_t part,
                   const std::function<void(std::size_t begin, std::size_t end)>& answer) {
    std::size_t round = firstParts * part;  // items between two looks for signals
    for (std::size_t begin = 0; begin < count;) {
        const std::size_t end = begin + std::min(round, count - begin);
        const Clock::time_point start = Clock::now();
        {
            const py::gil_scoped_release release;
            if (end - begin <= part)
                answer(begin, end);
            else
                tbb::parallel_for(begin, end, part, [&](std::size_t i) { answer(i, std::min(i + part, end)); });
        }
        if (end < count) throwIfSignalled();
        const auto took = Clock::now() - start;
        if (took < pollInterval) round *= 2;
        if (took > 4 * pollInterval) round = std::max(part, round / 2 / part * part);
        begin = end;
    }
}

}  // namespace bilayer::python
