// SPDX-License-Identifier: Apache-2.0
#include "bench/bandwidth.h"

#include <sys/mman.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <glm/vec3.hpp>
#include <memory>
#include <new>
#include <vector>

#include "bench/measure.h"
#include "sdf/base/hash.h"

namespace bilayer::bench {

using namespace detail;
namespace {

constexpr std::size_t streamedBytes = std::size_t(1) << 29;  // larger than any cache
constexpr std::size_t largePage = std::size_t(1) << 21;      // [bytes]
constexpr std::size_t randomReads = std::size_t(1) << 22;    // per thread
constexpr int rounds = 5;

volatile std::uint64_t sink;

// Allocates memory and writes to all of it, in large pages if the machine grants them.
std::unique_ptr<std::uint64_t[], decltype(&std::free)> pages(std::size_t bytes) {
    const std::size_t whole = (bytes + largePage - 1) / largePage * largePage;
    void* const memory = std::aligned_alloc(largePage, whole);
    if (!memory) throw std::bad_alloc();
    ::madvise(memory, whole, MADV_HUGEPAGE);
    std::memset(memory, 1, whole);
    return {static_cast<std::uint64_t*>(memory), &std::free};
}

// Rate of `work` per second: the median of some rounds.
template <class Work>
double rate(double amount, int threads, const Work& work) {
    std::vector<double> rates;
    for (int round = 0; round < rounds; ++round) {
        const Stopwatch watch;
        onThreads(threads, work);
        rates.push_back(amount / watch.seconds());
    }
    return median(rates);
}

}  // namespace

double streamBandwidth(int threads) {
    const auto buffer = pages(streamedBytes);
    const std::size_t share = streamedBytes / sizeof(std::uint64_t) / std::size_t(threads);
    return rate(double(streamedBytes), threads, [&](int thread) {
        const std::uint64_t* const part = buffer.get() + std::size_t(thread) * share;
        std::uint64_t sum = 0;
        for (std::size_t i = 0; i < share; ++i) sum += part[i];
        sink = sum;
    });
}

double randomLines(std::size_t bytes, int threads) {
    const auto buffer = pages(bytes);
    const std::size_t lines = bytes / cacheLine;
    return rate(double(randomReads) * threads, threads, [&](int thread) {
        std::uint64_t sum = 0;
        for (std::size_t i = 0; i < randomReads; ++i) {
            // the high half of the product is uniform over any count of lines, without a division
            // mixed well, so that no prefetcher detects a stride
            const std::uint64_t place = (detail::mixedBits(i + std::size_t(thread) * randomReads) >> 32) * lines >> 32;
            sum += buffer[place * (cacheLine / sizeof(std::uint64_t))];
        }
        sink = sum;
    });
}

Touched linesTouched(const FieldLayout& field, std::span<const glm::vec3> points) {
    constexpr int stride = FieldLayout::stride;
    std::vector<std::uintptr_t> all;
    std::size_t each = 0;
    for (const glm::vec3& point : points) {
        const glm::ivec3 voxel((glm::dvec3(point) - field.origin) * field.perMetre), inBlock = voxel & 7;
        const std::int32_t& block = field.directory[field.entryOf(voxel >> 3)];
        const float* const first = field.values.data() + std::size_t(block) * FieldLayout::blockFloats +
                                   (inBlock.x * stride + inBlock.y) * stride + inBlock.z;
        std::vector<std::uintptr_t> lines{reinterpret_cast<std::uintptr_t>(&block) / cacheLine};
        for (const int row : {0, stride, stride * stride, stride * stride + stride})
            for (const int z : {0, 1}) lines.push_back(reinterpret_cast<std::uintptr_t>(first + row + z) / cacheLine);
        std::sort(lines.begin(), lines.end());
        lines.erase(std::unique(lines.begin(), lines.end()), lines.end());
        each += lines.size();
        all.insert(all.end(), lines.begin(), lines.end());
    }
    std::sort(all.begin(), all.end());
    const auto distinct = std::unique(all.begin(), all.end()) - all.begin();
    return {double(each) / double(points.size()), double(distinct) / double(points.size())};
}

}  // namespace bilayer::bench
