// Work on the parts of a file in parallel, with the errors of a reader that goes from its beginning to its end;
// internal.
#pragma once

#include <oneapi/tbb/parallel_for.h>

#include <atomic>
#include <cstddef>
#include <exception>
#include <limits>
#include <mutex>

namespace bilayer::detail {

/// Calls work(i) for each i below `count`, in parallel. Throws what the first of them threw, whichever came first.
template <class Work>
void inOrder(std::size_t count, Work work) {
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
