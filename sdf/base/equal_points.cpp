// SPDX-License-Identifier: Apache-2.0
// Two rounds of hash tables that fit into a core's cache. The first round searches runs of consecutive points, since
// equal points are mostly close in the list. The second round searches the remaining points of all runs, partitioned by
// hash. If the sample at the start of a run has no equal points, the run is left to the second round.
#include "sdf/base/equal_points.h"

#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <glm/common.hpp>
#include <numeric>
#include <utility>
#include <vector>

#include "sdf/base/progress.h"

namespace bilayer::detail {
namespace {

constexpr std::size_t pointsPerRun = 1 << 15;        // points
constexpr std::size_t sampleLength = 1 << 11;        // points in the sample at the start of a run
constexpr std::size_t pointsPerPartition = 1 << 12;  // approximate
constexpr std::size_t maxPartitions = 1 << 10;

// Coordinates as words that are equal if and only if the coordinates are equal.
struct Bits {
    std::uint32_t x, y, z;

    // adding zero turns -0 into 0
    explicit Bits(const glm::vec3& p)
        : x(std::bit_cast<std::uint32_t>(p.x + 0.0f)),
          y(std::bit_cast<std::uint32_t>(p.y + 0.0f)),
          z(std::bit_cast<std::uint32_t>(p.z + 0.0f)) {}

    bool operator==(const Bits&) const = default;

    // The folded halves of a 128-bit product.
    std::uint64_t hash() const {
        __extension__ using Wide = unsigned __int128;
        const std::uint64_t xy = x | std::uint64_t(y) << 32;
        const Wide product = Wide(xy ^ 0x9e3779b97f4a7c15u) * ((z * 0xbf58476d1ce4e5b9u) ^ 0xd1b54a32d192ed03u);
        return std::uint64_t(product) ^ std::uint64_t(product >> 64);
    }
};

// A hash table of earlier keys: open addressing, at most half full.
template <class Index>
class Table {
  public:
    void clear(std::size_t keys) { slots_.assign(std::bit_ceil(2 * keys), none); }

    // Returns the index of an equal item that was added before. If there is none, adds `index` and returns it.
    template <class Equal>
    Index add(std::uint64_t hash, Index index, Equal equal) {
        const std::size_t mask = slots_.size() - 1;
        std::size_t slot = hash & mask;
        while (slots_[slot] != none && !equal(slots_[slot])) slot = (slot + 1) & mask;
        if (slots_[slot] == none) slots_[slot] = index;
        return slots_[slot];
    }

  private:
    static constexpr Index none = Index(~Index(0));
    std::vector<Index> slots_;
};

class EqualPoints {
  public:
    EqualPoints(std::span<const glm::vec3> points, Progress* progress)
        : points_(points),
          progress_(progress),
          first_(points.size()),
          runs_((points.size() + pointsPerRun - 1) / pointsPerRun),
          partitions_(std::min(maxPartitions, std::bit_ceil(points.size() / pointsPerPartition + 1))) {}

    LargeArray<unsigned> find() && {
        places_.resize(runs_ * partitions_);
        forEach(runs_, [&](std::size_t run) { searchRun(run); });
        if (runs_ > 1) {
            const std::vector<std::size_t> begins = makePlaces();
            rest_ = LargeArray<Item>(begins.back());
            forEach(runs_, [&](std::size_t run) { scatter(run); });
            forEach(partitions_, [&](std::size_t i) { searchPartition(begins[i], begins[i + 1]); });
            if (anyEqual_) forEach(runs_, [&](std::size_t run) { follow(run); });
        }
        return anyEqual_ ? std::move(first_) : LargeArray<unsigned>();
    }

  private:
    struct Item {
        std::uint32_t hash;  // lower bits of the hash
        unsigned index;
    };

    template <class Body>
    void forEach(std::size_t count, Body body) {
        const auto polled = [&](std::size_t i) {
            poll(progress_);
            body(i);
        };
        if (count == 1) return polled(0);
        tbb::parallel_for(std::size_t(0), count, polled);
    }

    std::size_t beginOf(std::size_t run) const { return run * pointsPerRun; }
    std::size_t endOf(std::size_t run) const { return std::min(points_.size(), beginOf(run) + pointsPerRun); }
    // Uses the upper bits, because tables use the lower ones.
    std::size_t partitionOf(std::uint64_t hash) const { return (hash >> 32) & (partitions_ - 1); }

    Bits bitsAt(std::size_t i) const { return Bits(points_[i]); }

    // Finds the first of equal points within a run, and counts what remains for each partition.
    void searchRun(std::size_t run) {
        const std::size_t begin = beginOf(run), end = endOf(run);
        const std::size_t sample = runs_ > 1 ? std::min(begin + sampleLength, end) : end;
        const bool repeats = searchFirsts(begin, sample);
        if (repeats && sample < end)
            searchFirsts(begin, end);
        else
            std::iota(first_.data() + sample, first_.data() + end, unsigned(sample));
        if (repeats) anyEqual_.store(true, std::memory_order_relaxed);
        if (runs_ == 1) return;
        std::size_t* counts = places_.data() + run * partitions_;
        for (std::size_t i = begin; i < end; ++i)
            if (first_[i] == i) ++counts[partitionOf(bitsAt(i).hash())];
    }

    // Returns whether any points of a part of a run are equal, and sets the first equal point of each.
    bool searchFirsts(std::size_t begin, std::size_t end) {
        thread_local Table<std::uint16_t> table;
        table.clear(end - begin);
        bool repeats = false;
        for (std::size_t i = begin; i < end; ++i) {
            const Bits bits = bitsAt(i);
            const std::size_t first =
                begin + table.add(bits.hash(), std::uint16_t(i - begin),
                                  [&](std::uint16_t other) { return bitsAt(begin + other) == bits; });
            first_[i] = unsigned(first);
            repeats |= first != i;
        }
        return repeats;
    }

    // Converts counts into positions, ordered by partition and then by run. Returns the start of each partition.
    std::vector<std::size_t> makePlaces() {
        std::vector<std::size_t> begins(partitions_ + 1);
        std::size_t sum = 0;
        for (std::size_t i = 0; i < partitions_; ++i) {
            begins[i] = sum;
            for (std::size_t run = 0; run < runs_; ++run) sum += std::exchange(places_[run * partitions_ + i], sum);
        }
        begins.back() = sum;
        return begins;
    }

    void scatter(std::size_t run) {
        std::size_t* places = places_.data() + run * partitions_;
        for (std::size_t i = beginOf(run); i < endOf(run); ++i) {
            if (first_[i] != i) continue;
            const std::uint64_t hash = bitsAt(i).hash();
            rest_[places[partitionOf(hash)]++] = {std::uint32_t(hash), unsigned(i)};
        }
    }

    // Items are in the order of their indices, so the first match is the first of all equal points.
    void searchPartition(std::size_t begin, std::size_t end) {
        thread_local Table<std::uint32_t> table;
        table.clear(end - begin);
        const Item* items = rest_.data() + begin;
        bool repeats = false;
        for (std::size_t i = 0; i < end - begin; ++i) {
            const Item& item = items[i];
            const std::uint32_t first = table.add(item.hash, std::uint32_t(i), [&](std::uint32_t other) {
                return items[other].hash == item.hash && bitsAt(items[other].index) == bitsAt(item.index);
            });
            if (first == i) continue;
            first_[item.index] = items[first].index;
            repeats = true;
        }
        if (repeats) anyEqual_.store(true, std::memory_order_relaxed);
    }

    // Replaces the first point within a run by the first of all.
    void follow(std::size_t run) {
        for (std::size_t i = beginOf(run); i < endOf(run); ++i)
            if (first_[i] >= beginOf(run)) first_[i] = first_[first_[i]];
    }

    std::span<const glm::vec3> points_;
    Progress* progress_;
    LargeArray<unsigned> first_;
    std::size_t runs_, partitions_;
    std::vector<std::size_t> places_;  // per run and partition: first the count, then the position of its next item
    LargeArray<Item> rest_;            // the first points of each run, grouped by partition
    std::atomic<bool> anyEqual_ = false;
};

}  // namespace

LargeArray<unsigned> firstOfEqual(std::span<const glm::vec3> points, Progress* progress) {
    return EqualPoints(points, progress).find();
}

}  // namespace bilayer::detail
