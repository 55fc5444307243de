// SPDX-License-Identifier: Apache-2.0
// Time, memory and the few statistics that the benchmarks print.
//
// The loops are plain, without a benchmark library: the results are ratios between builders on a shared machine.
// Builders take turns (A B C A B C ...), so a slow minute affects all of them alike. A benchmark library finishes the
// repetitions of one benchmark before the next, or shuffles them; a slow minute then distorts a ratio. In addition, the
// peak memory of each builder requires a process of its own.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "bench/builders.h"
#include "sdf/base/stopwatch.h"

namespace bilayer::bench {

using detail::Stopwatch;

/// Limit of peak memory: this factor times input plus output, plus a constant. The constant covers what does not grow:
/// thread stacks, the allocator's pools, one brick in work per thread.
inline constexpr double memoryFactor = 1.5, memoryConstantMiB = 64;

/// The median; NaN for no values.
double median(std::vector<double> values);

/// NaN for no values.
double geometricMean(const std::vector<double>& values);

/// The slope of the least-squares line through (log x, log y): y grows with x to this power. NaN for fewer than two
/// points.
double logSlope(const std::vector<double>& x, const std::vector<double>& y);

/// Runs work(0) ... work(threads - 1) concurrently and waits for all. work(0) runs on the calling thread, each other on
/// its own.
void onThreads(int threads, const std::function<void(int)>& work);

/// Difference between two fields of the same mesh.
struct Difference {
    std::uint64_t voxels = 0;  ///< active in one of the fields only
    std::uint64_t signs = 0;   ///< differing signs of voxels in blocks that both have
    float distance = 0;        ///< maximum over voxels active in both; infinite if one is not a number [voxels]
};
Difference difference(const LevelSet& a, const LevelSet& b);

/// Cost of a build in its own process.
struct Footprint {
    Outcome outcome;               ///< `seconds` is the median of all repetitions
    std::uint64_t triangles = 0;   ///< of the mesh
    std::uint64_t inputBytes = 0;  ///< of the mesh
    std::uint64_t peakBytes = 0;   ///< peak resident memory during the first build, minus that before it

    double peakMiB() const;     ///< mesh and build together
    double allowedMiB() const;  ///< limit of the peak: a factor times mesh and grid, plus a constant
};

/// Builds in a child process, so that no builder sees memory or heap fragmentation left by another. Repeats until
/// `repetitions` builds are done or `seconds` have passed, at least once.
/// @param make  makes the scene, in the child
/// Throws std::logic_error if this process has started threads: the child would lack them, and waiting for them would
/// deadlock. Throws std::runtime_error with the error text if the child failed.
Footprint inChild(const std::function<Scene()>& make, const Job& job, int repetitions = 1, double seconds = 0);

/// Peak memory of `work` beyond the resident memory before it, in its own child process [bytes].
/// @param prepare  runs first, and is not counted
/// Throws as inChild() does.
std::uint64_t peakInChild(const std::function<void()>& prepare, const std::function<void()>& work);

}  // namespace bilayer::bench
