// Time, memory and the few statistics that the benchmarks print.
//
// Plain loops instead of a benchmark library: what counts here are ratios between builders on a machine that others use
// too. Builders take turns (A B C A B C ...), so that a slow minute hits all of them alike; a library that repeats one
// benchmark before it starts the next, or shuffles repetitions, lets such a minute decide a ratio. And the peak of
// memory needs a process of its own for each builder.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <vector>

#include "bench/builders.h"

namespace bilayer::bench {

/// Runs from its construction on.
class Stopwatch {
  public:
    double seconds() const { return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count(); }

  private:
    std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

/// Memory at the peak may be this times input plus output, plus a constant for what does not grow: thread stacks, the
/// allocator's pools, one brick in work for each thread.
inline constexpr double memoryFactor = 1.5, memoryConstantMiB = 64;

/// The median; NaN of nothing.
double median(std::vector<double> values);

/// NaN of nothing.
double geometricMean(const std::vector<double>& values);

/// The slope of the line through (log x, log y) that fits best: y grows with x to this power. NaN below two points.
double logSlope(const std::vector<double>& x, const std::vector<double>& y);

/// Runs work(0) ... work(threads - 1) at once, each on a thread of its own but the first, and waits for all.
void onThreads(int threads, const std::function<void(int)>& work);

/// How two fields of the same mesh differ.
struct Difference {
    std::uint64_t voxels = 0;  ///< active in one of them only
    std::uint64_t signs = 0;   ///< of voxels in blocks that both have
    float distance = 0;        ///< the largest, over voxels active in both; infinite for no number [voxels]
};
Difference difference(const LevelSet& a, const LevelSet& b);

/// What a build takes in a process of its own.
struct Footprint {
    Outcome outcome;               ///< `seconds` is the median of all repetitions
    std::uint64_t triangles = 0;   ///< of the mesh
    std::uint64_t inputBytes = 0;  ///< of the mesh
    std::uint64_t peakBytes = 0;   ///< most that was resident during the first build, less what was before it

    double peakMiB() const;     ///< of mesh and build together
    double allowedMiB() const;  ///< what the peak may be: a part more than mesh and grid, and a constant
};

/// Builds in a child process, so that no builder finds memory that another one left, or a heap that it has broken up.
/// Repeats until `repetitions` builds are done or `seconds` are spent, at least once.
/// @param make  makes the scene, in the child
/// Throws std::logic_error if this process has started threads: they would be missing from the child, and what
/// waits for them there would wait for ever. Throws std::runtime_error with its text if the child failed.
Footprint inChild(const std::function<Scene()>& make, const Job& job, int repetitions = 1, double seconds = 0);

/// What work takes at its peak beyond what was resident before it, in a child process of its own [bytes].
/// @param prepare  runs before, and is not counted
/// Throws as inChild() does.
std::uint64_t peakInChild(const std::function<void()>& prepare, const std::function<void()>& work);

}  // namespace bilayer::bench
