// SPDX-License-Identifier: Apache-2.0
// Parallel work on the parts of a file that reports the same error as a sequential reader; internal.
// Tested by tests/sdf/mesh_readers.cpp through readMesh().
#pragma once

#include <oneapi/tbb/parallel_for.h>

#include <atomic>
#include <cstddef>
#include <exception>
#include <limits>
#include <mutex>

namespace bilayer::detail {

/// Calls work(i) for each i below `count`, in parallel. Rethrows the exception with the lowest i, whichever was thrown
/// first.
template <class Work>
void inParallel(std::size_t count, Work work) {
    if (count == 1) return work(std::size_t(0));
    std::atomic<std::size_t> failed = std::numeric_limits<std::size_t>::max();
    std::exception_ptr error;
    std::mutex mutex;
    tbb::parallel_for(std::size_t(0), count, [&](std::size_t i) {
        if (i > failed) return;
        try {
            work(i);
        } catch (...) {
            const std::lock_guard lock(mutex);
            if (i < failed) failed = i, error = std::current_exception();
        }
    });
    if (error) std::rethrow_exception(error);
}

}  // namespace bilayer::detail
