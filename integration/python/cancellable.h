// SPDX-License-Identifier: Apache-2.0
// Long calls that Ctrl-C cancels.
#pragma once

#include <pybind11/pybind11.h>

#include <cstddef>
#include <functional>
#include <optional>
#include <utility>

namespace bilayer::python {

namespace py = pybind11;

/// As BuildOptions::progress.
using ProgressCallback = std::function<bool(float)>;

/// Runs a job on another thread and without the GIL. The calling thread, to which signals belong, looks for Ctrl-C
/// and calls `progress` with the completed fraction. Call this with the GIL held.
/// @param progress  a callable, which cancels by returning False, or None
/// Throws what the job throws, what `progress` or a signal handler raises, and Cancelled; always after the job's end.
void runCancellable(const py::object& progress, const std::function<void(const ProgressCallback&)>& job);

/// The same for a job with a result.
template <class Job>
auto cancellable(const py::object& progress, Job job) {
    std::optional<decltype(job(ProgressCallback()))> result;
    runCancellable(progress, [&](const ProgressCallback& progressCallback) { result.emplace(job(progressCallback)); });
    return std::move(*result);
}

/// Answers a batch in parts on all cores, without the GIL, and looks for Ctrl-C after the first group and then about
/// every 20 ms. Call this with the GIL held.
/// @param group   count of items that stay together: parts are whole groups, but for the last
/// @param answer  answers the items of [begin, end); called from any thread, concurrently
/// Throws what `answer` throws, and what a signal handler raises.
void answerInParts(std::size_t count, std::size_t group,
                   const std::function<void(std::size_t begin, std::size_t end)>& answer);

}  // namespace bilayer::python
