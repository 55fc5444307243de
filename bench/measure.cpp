// SPDX-License-Identifier: Apache-2.0
#include "bench/measure.h"

#include <malloc.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <stdexcept>
#include <thread>

#include <bilayer/sdf/grids.h>
#include "sdf/base/openvdb.h"

namespace bilayer::bench {
namespace {

constexpr double MiB = 1 << 20;
constexpr float infinity = std::numeric_limits<float>::infinity();
constexpr double none = std::numeric_limits<double>::quiet_NaN();
// writing this to /proc/self/clear_refs resets the peak "VmHWM" of /proc/self/status
constexpr const char* resetPeak = "5";

// The child's reply, sent in one piece through a pipe.
struct Answer {
    bool ok = false;
    Footprint footprint;
    std::array<char, 256> error{};
};

std::uint64_t statusBytes(const std::string& key) {
    std::ifstream file("/proc/self/status");
    std::string word;
    std::uint64_t kiB = 0;
    while (file >> word)
        if (word == key) file >> kiB;
    return kiB * 1024;
}

std::uint64_t peakOf(const std::function<void()>& work) {
    ::malloc_trim(0);
    const std::uint64_t before = statusBytes("VmRSS:");
    std::ofstream("/proc/self/clear_refs") << resetPeak;
    work();
    return statusBytes("VmHWM:") - before;
}

Footprint measure(const Scene& scene, const Job& job, int repetitions, double seconds) {
    Footprint result;
    result.peakBytes = peakOf([&] { result.outcome = run(scene, job); });
    result.triangles = scene.mesh.triangles.size();
    result.inputBytes = scene.mesh.points.size() * sizeof(scene.mesh.points[0]) +
                        scene.mesh.triangles.size() * sizeof(scene.mesh.triangles[0]);
    std::vector<double> times{result.outcome.seconds};
    double spent = times[0];
    while (int(times.size()) < repetitions && spent < seconds) {
        times.push_back(run(scene, job).seconds);
        spent += times.back();
    }
    result.outcome.seconds = median(times);
    return result;
}

// Runs in the child until it exits. It must neither return into the parent's code nor run the parent's exit handlers.
[[noreturn]] void live(int pipe, const std::function<Footprint()>& work) {
    Answer answer;
    try {
        answer.footprint = work();
        answer.ok = true;
    } catch (const std::exception& error) {
        std::string(error.what()).copy(answer.error.data(), answer.error.size() - 1);
    }
    const bool sent = ::write(pipe, &answer, sizeof answer) == ssize_t(sizeof answer);
    ::_exit(sent ? 0 : 1);
}

std::size_t threadsOfThisProcess() {
    const std::filesystem::directory_iterator tasks("/proc/self/task");
    return std::size_t(std::distance(begin(tasks), end(tasks)));
}

// Before main() the only threads are those that libraries start on loading (log4cplus, through OpenVDB). They wait for
// log messages, and no other thread waits for them.
const std::size_t threadsAtStart = threadsOfThisProcess();

// Result of `work` in a child process.
Footprint answerOfChild(const std::string& name, const std::function<Footprint()>& work) {
    if (threadsOfThisProcess() != threadsAtStart)
        throw std::logic_error("a process that runs several threads cannot be forked safely");
    int ends[2];
    if (::pipe(ends) != 0) throw std::runtime_error("no pipe to a child process");
    const pid_t child = ::fork();
    if (child < 0) throw std::runtime_error("no child process");
    if (child == 0) {
        ::close(ends[0]);
        live(ends[1], work);
    }
    ::close(ends[1]);
    Answer answer;
    const bool received = ::read(ends[0], &answer, sizeof answer) == ssize_t(sizeof answer);
    ::close(ends[0]);
    ::waitpid(child, nullptr, 0);
    if (!received) throw std::runtime_error(name + ": the child process died");
    if (!answer.ok) throw std::runtime_error(name + ": " + answer.error.data());
    return answer.footprint;
}

}  // namespace

double Footprint::peakMiB() const {
    return double(inputBytes + peakBytes) / MiB;
}

double Footprint::allowedMiB() const {
    return memoryFactor * double(inputBytes + outcome.bytes) / MiB + memoryConstantMiB;
}

double median(std::vector<double> values) {
    if (values.empty()) return none;
    std::sort(values.begin(), values.end());
    const std::size_t middle = values.size() / 2;
    return values.size() % 2 ? values[middle] : (values[middle - 1] + values[middle]) / 2;
}

double geometricMean(const std::vector<double>& values) {
    double sum = 0;
    for (const double value : values) sum += std::log(value);
    return values.empty() ? none : std::exp(sum / double(values.size()));
}

double logSlope(const std::vector<double>& x, const std::vector<double>& y) {
    const std::size_t count = std::min(x.size(), y.size());
    if (count < 2) return none;
    double mx = 0, my = 0, xx = 0, xy = 0;
    for (std::size_t i = 0; i < count; ++i) {
        mx += std::log(x[i]) / double(count);
        my += std::log(y[i]) / double(count);
    }
    for (std::size_t i = 0; i < count; ++i) {
        xx += (std::log(x[i]) - mx) * (std::log(x[i]) - mx);
        xy += (std::log(x[i]) - mx) * (std::log(y[i]) - my);
    }
    return xy / xx;
}

void onThreads(int threads, const std::function<void(int)>& work) {
    std::vector<std::jthread> others;
    for (int thread = 1; thread < threads; ++thread) others.emplace_back(work, thread);
    work(0);
}

Difference difference(const LevelSet& a, const LevelSet& b) {
    using Leaf = openvdb::FloatTree::LeafNodeType;
    const openvdb::FloatTree &one = a.grids().distance->tree(), &other = b.grids().distance->tree();
    Difference result;
    for (auto leaf = one.cbeginLeaf(); leaf; ++leaf) {
        const Leaf* const match = other.probeConstLeaf(leaf->origin());
        if (!match) {
            result.voxels += leaf->onVoxelCount();
            continue;
        }
        result.voxels += (leaf->getValueMask() ^ match->getValueMask()).countOn();
        for (openvdb::Index i = 0; i < Leaf::SIZE; ++i) {
            const float x = leaf->getValue(i), y = match->getValue(i);
            result.signs += std::signbit(x) != std::signbit(y);
            if (!leaf->isValueOn(i) || !match->isValueOn(i)) continue;
            const float apart = std::abs(x - y) / a.voxelSize();
            result.distance = std::max(result.distance, std::isnan(apart) ? infinity : apart);
        }
    }
    for (auto leaf = other.cbeginLeaf(); leaf; ++leaf)
        if (!one.probeConstLeaf(leaf->origin())) result.voxels += leaf->onVoxelCount();
    return result;
}

Footprint inChild(const std::function<Scene()>& make, const Job& job, int repetitions, double seconds) {
    return answerOfChild(nameOf(job.builder), [&] { return measure(make(), job, repetitions, seconds); });
}

std::uint64_t peakInChild(const std::function<void()>& prepare, const std::function<void()>& work) {
    const auto peak = [&] {
        prepare();
        Footprint footprint;
        footprint.peakBytes = peakOf(work);
        return footprint;
    };
    return answerOfChild("work", peak).peakBytes;
}

}  // namespace bilayer::bench
