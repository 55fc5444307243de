// SPDX-License-Identifier: Apache-2.0
// Hilbert order: J. Skilling, "Programming the Hilbert curve", AIP Conference Proceedings 707 (2004) 381-387. The
// layout is that of packed R-trees: I. Kamel, C. Faloutsos, "On packing R-trees", CIKM 1993, 490-499.
#include "sdf/bvh/box_tree.h"

#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/parallel_invoke.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstring>
#include <glm/common.hpp>
#include <limits>
#include <utility>

#include "sdf/base/polled_loop.h"

namespace bilayer::detail {
namespace {

constexpr int bitsPerAxis = 12, indexBits = 28, keyBits = 3 * bitsPerAxis;
static_assert(curveCells == 1u << bitsPerAxis && maxOnCurve == std::size_t(1) << indexBits);
/// Digit size of the radix sort; three passes sort a key.
constexpr int digitBits = 12;
constexpr std::size_t digits = std::size_t(1) << digitBits;
static_assert(keyBits % digitBits == 0 && keyBits + indexBits == 64);
constexpr std::size_t keysPerRun = 1 << 15;  // keys that one task sorts at a time; greater than `digits`
/// Min count of items for which splitting starts another task.
constexpr std::size_t worthSplitting = 1 << 15;
/// On average, each round of the selection halves the range until it is short. After this many rounds std::nth_element
/// takes over.
constexpr int maxRounds = 64;
constexpr std::ptrdiff_t shortRun = 24;

// Spreads 12 bits to every third bit.
std::uint64_t spread(std::uint64_t x) {
    x = (x | x << 16) & 0xff0000ff;
    x = (x | x << 8) & 0xf00f00f;
    x = (x | x << 4) & 0xc30c30c3;
    return (x | x << 2) & 0x249249249;
}

// Converts cells to their positions along the Hilbert curve, by Skilling's transformation without branches. The
// position of a cell is the interleaved bits of the three numbers.
void transformToHilbert(CurveCells& cells) {
    auto &x = cells.x[0], &y = cells.x[1], &z = cells.x[2];
    const auto undo = [&](int bit, std::uint32_t* v) {
        for (std::size_t i = 0; i < CurveCells::capacity; ++i) {
            const std::uint32_t inverts = 0u - (v[i] >> bit & 1), low = (1u << bit) - 1;
            const std::uint32_t swapped = (x[i] ^ v[i]) & low & ~inverts;
            x[i] ^= (low & inverts) | swapped;
            v[i] ^= swapped;
        }
    };
    for (int bit = bitsPerAxis - 1; bit > 0; --bit) {
        for (std::size_t i = 0; i < CurveCells::capacity; ++i) x[i] ^= (0u - (x[i] >> bit & 1)) & ((1u << bit) - 1);
        undo(bit, y);
        undo(bit, z);
    }
    for (std::size_t i = 0; i < CurveCells::capacity; ++i) {
        y[i] ^= x[i];
        z[i] ^= y[i];
        std::uint32_t parity = z[i] >> 1;  // bit b: parity of the bits of z above b
        for (int shift = 1; shift < bitsPerAxis; shift *= 2) parity ^= parity >> shift;
        x[i] ^= parity;
        y[i] ^= parity;
        z[i] ^= parity;
    }
}

// Sorts items by recursive splitting at the median along the longest axis. Each part fills whole groups of the tree.
class Splitter {
  public:
    Splitter(std::vector<TreeItem>& items, Progress* progress) : items_(items), progress_(progress) {}

    void sort() {
        std::size_t size = treeWidth;  // items per child
        while (size * treeWidth < items_.size()) size *= treeWidth;
        split(0, items_.size(), size);
    }

  private:
    using Whole [[gnu::vector_size(sizeof(TreeItem))]] = float;

    static Whole wholeOf(const TreeItem* item) {
        Whole whole;
        std::memcpy(&whole, item, sizeof whole);
        return whole;
    }

    static bool less(const TreeItem& a, const TreeItem& b, int axis) {
        const float x = a.place[axis], y = b.place[axis];
        return bool(int(x < y) | (int(x == y) & int(a.index < b.index)));
    }

    // Equals std::nth_element, but without unpredictable branches.
    static void select(TreeItem* begin, TreeItem* middle, TreeItem* end, int axis) {
        const auto isBefore = [axis](const TreeItem& a, const TreeItem& b) { return less(a, b, axis); };
        for (int round = 0; round < maxRounds && end - begin > shortRun; ++round) {
            // all items differ, so at least one is less than the median of three
            std::array<TreeItem, 3> some{*begin, begin[(end - begin) / 2], end[-1]};
            std::sort(some.begin(), some.end(), isBefore);
            TreeItem* store = begin;
            for (TreeItem* i = begin; i < end; ++i) {
                // copied as whole vectors: a load that spans several recent smaller stores would stall
                const bool before = less(*i, some[1], axis);
                const Whole here = wholeOf(i), there = wholeOf(store);
                std::memcpy(i, &there, sizeof there);
                std::memcpy(store, &here, sizeof here);
                store += before;
            }
            (middle < store ? end : begin) = store;
        }
        std::nth_element(begin, middle, end, isBefore);
    }

    void split(std::size_t begin, std::size_t end, std::size_t size) {
        while (end - begin <= size) {
            if (size == treeWidth) return;
            size /= treeWidth;
        }
        poll(progress_);
        const std::size_t children = (end - begin + size - 1) / size, middle = begin + (children + 1) / 2 * size;
        glm::vec3 lower(std::numeric_limits<float>::infinity()), upper(-lower);
        for (std::size_t i = begin; i < end; ++i)
            lower = glm::min(lower, items_[i].place), upper = glm::max(upper, items_[i].place);
        const glm::vec3 sides = upper - lower;
        const int axis = sides.x >= sides.y && sides.x >= sides.z ? 0 : sides.y >= sides.z ? 1 : 2;
        select(items_.data() + begin, items_.data() + middle, items_.data() + end, axis);
        const auto left = [&] { split(begin, middle, size); };
        const auto right = [&] { split(middle, end, size); };
        if (end - begin > worthSplitting)
            tbb::parallel_invoke(left, right);
        else
            left(), right();
    }

    std::vector<TreeItem>& items_;
    Progress* progress_;
};

void setBox(BoxGroup& group, std::size_t place, const glm::vec3& lower, const glm::vec3& upper) {
    for (int i = 0; i < 3; ++i) {
        group.lower[i][place] = lower[i];
        group.upper[i][place] = upper[i];
    }
}

// Joins the boxes of a group into one box of its parent.
void joinInto(const BoxGroup& group, BoxGroup& parent, std::size_t place) {
    glm::vec3 lower, upper;
    for (int i = 0; i < 3; ++i) {
        lower[i] = *std::min_element(group.lower[i], group.lower[i] + treeWidth);
        upper[i] = *std::max_element(group.upper[i], group.upper[i] + treeWidth);
    }
    setBox(parent, place, lower, upper);
}

void emptyBoxes(BoxGroup& group, std::size_t from) {
    constexpr float infinity = std::numeric_limits<float>::infinity();
    for (std::size_t i = from; i < treeWidth; ++i) setBox(group, i, glm::vec3(infinity), glm::vec3(-infinity));
}

std::uint32_t groupsOver(std::uint32_t leaves) {
    std::uint32_t total = 0;
    do {
        leaves = (leaves + treeWidth - 1) / treeWidth;
        total += leaves;
    } while (leaves > 1);
    return total;
}

}  // namespace

void BoxTree::makeRoom(std::size_t leaves) {
    leafCount = std::uint32_t(leaves);
    groupCount = groupsOver(leafCount);
    groups = LargeArray<BoxGroup>(groupCount);
}

void BoxTree::setLeafBox(std::size_t leaf, const glm::vec3& lower, const glm::vec3& upper) {
    setBox(groups[leaf / treeWidth], leaf % treeWidth, lower, upper);
}

void BoxTree::joinBoxes(Progress* progress) {
    std::uint32_t begin = 0, children = leafCount, firstChild = 0;  // of the level below
    for (;;) {
        const std::uint32_t count = (children + treeWidth - 1) / treeWidth;
        for (std::uint32_t i = 0; i < count; ++i) groups[begin + i].firstChild = firstChild + i * treeWidth;
        emptyBoxes(groups[begin + count - 1], children - (count - 1) * treeWidth);
        if (count == 1) return;
        forAllPolled(count, progress, [&](std::size_t i) {
            joinInto(groups[begin + i], groups[begin + count + i / treeWidth], i % treeWidth);
        });
        firstChild = leafCount + begin;
        begin += count;
        children = count;
    }
}

void makeCurveKeys(CurveCells& cells, std::size_t first, std::size_t count, std::uint64_t* keys) {
    transformToHilbert(cells);
    for (std::size_t i = 0; i < count; ++i) {
        const std::uint64_t place = spread(cells.x[0][i]) << 2 | spread(cells.x[1][i]) << 1 | spread(cells.x[2][i]);
        keys[i] = place << indexBits | (first + i);
    }
}

// A radix sort with parallel runs.
void sortCurveKeys(std::vector<std::uint64_t>& keys, Progress* progress) {
    const std::size_t runs = (keys.size() + keysPerRun - 1) / keysPerRun;
    auto other = vectorOf<std::uint64_t>(keys.size(), progress);
    std::vector<std::uint32_t> places(runs * digits);
    for (int shift = indexBits; shift < 64; shift += digitBits) {
        const auto forRun = [&](std::size_t run, auto body) {
            poll(progress);
            std::uint32_t* counts = places.data() + run * digits;
            for (std::size_t i = run * keysPerRun; i < std::min(keys.size(), (run + 1) * keysPerRun); ++i)
                body(keys[i], counts[keys[i] >> shift & (digits - 1)]);
        };
        tbb::parallel_for(std::size_t(0), runs, [&](std::size_t run) {
            std::fill_n(places.data() + run * digits, digits, 0u);
            forRun(run, [](std::uint64_t, std::uint32_t& count) { ++count; });
        });
        std::uint32_t sum = 0;
        for (std::size_t digit = 0; digit < digits; ++digit)
            for (std::size_t run = 0; run < runs; ++run) sum += std::exchange(places[run * digits + digit], sum);
        tbb::parallel_for(std::size_t(0), runs, [&](std::size_t run) {
            forRun(run, [&](std::uint64_t key, std::uint32_t& place) { other[place++] = key; });
        });
        keys.swap(other);
    }
}

void sortBySplitting(std::vector<TreeItem>& items, Progress* progress) {
    Splitter(items, progress).sort();
}

}  // namespace bilayer::detail
