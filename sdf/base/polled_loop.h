// SPDX-License-Identifier: Apache-2.0
// A parallel loop that can be cancelled.
// Tested by tests/sdf/progress.cpp through TriangleTree.
#pragma once

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

#include <cstddef>

#include "sdf/base/progress.h"

namespace bilayer::detail {

/// Calls body(i) for each i below `count` in parallel, in ranges of `grain`. Throws Cancelled.
template <class Body>
void forAllPolled(std::size_t count, std::size_t grain, Progress* progress, const Body& body) {
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, grain), [&](const auto& range) {
        for (std::size_t i = range.begin(); i < range.end(); ++i) {
            if (i % grain == 0) poll(progress);
            body(i);
        }
    });
}

/// The same where each call is short.
template <class Body>
void forAllPolled(std::size_t count, Progress* progress, const Body& body) {
    forAllPolled(count, 1024, progress, body);
}

}  // namespace bilayer::detail
