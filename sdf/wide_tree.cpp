// Sorting: J. Skilling, "Programming the Hilbert curve", AIP Conference Proceedings 707 (2004) 381-387. The layout is
// that of packed R-trees: I. Kamel, C. Faloutsos, "On packing R-trees", CIKM 1993, 490-499.
#include "sdf/wide_tree.h"

#include <hwy/cache_control.h>
#include <oneapi/tbb/enumerable_thread_specific.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/parallel_invoke.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <stdexcept>
#include <utility>

#include "sdf/progress.h"

namespace bilayer {
namespace {

/// Floats hold all whole numbers up to twice this [voxels].
constexpr double longestMesh = 1 << 23;
/// A sort key and the number of a part share 64 bits.
constexpr int bitsPerAxis = 12, indexBits = 28, keyBits = 3 * bitsPerAxis;
constexpr std::uint64_t indexMask = (std::uint64_t(1) << indexBits) - 1;
/// A pass of the radix sort; three passes sort a key.
constexpr int digitBits = 12;
constexpr std::size_t digits = std::size_t(1) << digitBits;
static_assert(keyBits % digitBits == 0 && keyBits + indexBits == 64);
constexpr std::size_t runLength = 1 << 15;  // keys that one task sorts at a time: more than digits
constexpr std::size_t grain = 1024;         // triangles or leaves a task
/// Selection halves what it looks at, on average, until there is little left; if not, it is done in another way.
constexpr int mostRounds = 64;
constexpr std::ptrdiff_t shortRun = 24;

using Corners = std::array<glm::dvec3, 3>;

struct Box {
    glm::dvec3 lower{std::numeric_limits<double>::infinity()}, upper{-std::numeric_limits<double>::infinity()};

    void add(const glm::dvec3& p) { lower = glm::min(lower, p), upper = glm::max(upper, p); }
};

template <class Body>
void forAll(std::size_t count, Progress* progress, Body body) {
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, grain), [&](const auto& range) {
        for (std::size_t i = range.begin(); i < range.end(); ++i) {
            if (i % grain == 0) poll(progress);
            body(i);
        }
    });
}

// The parts that the tree is made of: the triangles that are short enough, and the parts of those that are not.
class Parts {
  public:
    Parts(const Mesh& mesh, const glm::dvec3& base, double voxelSize, double longestEdge)
        : mesh_(mesh), base_(base), perVoxelSize_(1 / voxelSize), longest2_(longestEdge * longestEdge) {}

    Corners corners(std::size_t part) const {
        return part < mesh_.triangles.size() ? ofTriangle(part) : halves_[part - mesh_.triangles.size()].corners;
    }
    std::uint32_t triangle(std::size_t part) const {
        return part < mesh_.triangles.size() ? std::uint32_t(part) : halves_[part - mesh_.triangles.size()].triangle;
    }
    // Asks for memory ahead of its use: parts come in an order that the mesh does not know.
    void fetchIndices(std::size_t part) const {
        if (part < mesh_.triangles.size()) hwy::Prefetch(&mesh_.triangles[part]);
    }
    void fetchCorners(std::size_t part) const {
        if (part >= mesh_.triangles.size()) return;
        for (int i = 0; i < 3; ++i) hwy::Prefetch(&mesh_.points[mesh_.triangles[part][i]]);
    }
    std::size_t count() const { return mesh_.triangles.size() + halves_.size(); }

    // The longest edge, from this corner to the next, and its squared length.
    static std::pair<std::size_t, double> longest(const Corners& c) {
        const auto length2 = [&](std::size_t i) {
            const glm::dvec3 edge = c[(i + 1) % 3] - c[i];
            return glm::dot(edge, edge);
        };
        const std::array<double, 3> all{length2(0), length2(1), length2(2)};
        const auto edge = std::size_t(std::max_element(all.begin(), all.end()) - all.begin());
        return {edge, all[edge]};
    }
    bool isLong(const Corners& c) const { return longest(c).second > longest2_; }

    void halve(std::uint32_t triangle) { halve(ofTriangle(triangle), triangle); }

  private:
    struct Half {
        Corners corners;
        std::uint32_t triangle;
    };

    Corners ofTriangle(std::size_t index) const {
        const glm::uvec3& t = mesh_.triangles[index];
        return {local(t.x), local(t.y), local(t.z)};
    }
    glm::dvec3 local(unsigned point) const { return glm::dvec3(mesh_.points[point]) * perVoxelSize_ - base_; }

    void halve(const Corners& c, std::uint32_t triangle) {
        const auto [i, length2] = longest(c);
        if (length2 <= longest2_) {
            if (count() >= (std::size_t(1) << indexBits))
                throw std::invalid_argument("voxelSize is too small: the mesh has triangles too large for it");
            halves_.push_back({c, triangle});
            return;
        }
        const std::size_t j = (i + 1) % 3, k = (i + 2) % 3;
        const glm::dvec3 middle = 0.5 * (c[i] + c[j]);
        halve({c[i], middle, c[k]}, triangle);
        halve({middle, c[j], c[k]}, triangle);
    }

    const Mesh& mesh_;
    glm::dvec3 base_;
    double perVoxelSize_, longest2_;
    std::vector<Half> halves_;
};

// Spreads 12 bits to every third bit.
std::uint64_t spread(std::uint64_t x) {
    x = (x | x << 16) & 0xff0000ff;
    x = (x | x << 8) & 0xf00f00f;
    x = (x | x << 4) & 0xc30c30c3;
    return (x | x << 2) & 0x249249249;
}

// Cells in runs, so that the compiler can use vectors.
struct Cells {
    static constexpr std::size_t most = 64;
    std::uint32_t x[3][most];
};

// From cells to their places along Hilbert's curve, by Skilling's transformation without branches; the place of a cell
// is in the bits of the three numbers taken in turn.
void transformToHilbert(Cells& cells) {
    auto &x = cells.x[0], &y = cells.x[1], &z = cells.x[2];
    const auto undo = [&](int bit, std::uint32_t* v) {
        for (std::size_t i = 0; i < Cells::most; ++i) {
            const std::uint32_t inverts = 0u - (v[i] >> bit & 1), low = (1u << bit) - 1;
            const std::uint32_t swapped = (x[i] ^ v[i]) & low & ~inverts;
            x[i] ^= (low & inverts) | swapped;
            v[i] ^= swapped;
        }
    };
    for (int bit = bitsPerAxis - 1; bit > 0; --bit) {
        for (std::size_t i = 0; i < Cells::most; ++i) x[i] ^= (0u - (x[i] >> bit & 1)) & ((1u << bit) - 1);
        undo(bit, y);
        undo(bit, z);
    }
    for (std::size_t i = 0; i < Cells::most; ++i) {
        y[i] ^= x[i];
        z[i] ^= y[i];
        std::uint32_t parity = z[i] >> 1;  // bit b: of the bits of z above b
        for (int shift = 1; shift < bitsPerAxis; shift *= 2) parity ^= parity >> shift;
        x[i] ^= parity;
        y[i] ^= parity;
        z[i] ^= parity;
    }
}

// Sorts keys by their upper bits, stably: radix sort, runs side by side.
void sortKeys(std::vector<std::uint64_t>& keys, Progress* progress) {
    const std::size_t runs = (keys.size() + runLength - 1) / runLength;
    auto other = vectorOf<std::uint64_t>(keys.size(), progress);
    std::vector<std::uint32_t> places(runs * digits);
    for (int shift = indexBits; shift < 64; shift += digitBits) {
        const auto forRun = [&](std::size_t run, auto body) {
            poll(progress);
            std::uint32_t* counts = places.data() + run * digits;
            for (std::size_t i = run * runLength; i < std::min(keys.size(), (run + 1) * runLength); ++i)
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

/// The key of a part that is not used.
constexpr std::uint64_t unused = ~std::uint64_t(0);

// Keys of parts first .. first + count - 1; long triangles have none and are noted.
void makeKeys(const Parts& parts, const glm::ivec3& size, std::size_t first, std::size_t count, std::uint64_t* keys,
              std::vector<std::uint32_t>& longOnes) {
    constexpr double cells = 1 << bitsPerAxis;
    const double scale = cells / (3.0 * std::max({size.x, size.y, size.z}));
    Cells run{};
    std::array<bool, Cells::most> isLong{};
    for (std::size_t i = 0; i < count; ++i) {
        const Corners c = parts.corners(first + i);
        for (int k = 0; k < 3; ++k)
            run.x[k][i] = std::uint32_t(std::clamp((c[0][k] + c[1][k] + c[2][k]) * scale, 0.0, cells - 1));
        isLong[i] = parts.isLong(c);
    }
    transformToHilbert(run);
    for (std::size_t i = 0; i < count; ++i) {
        const std::uint64_t place = spread(run.x[0][i]) << 2 | spread(run.x[1][i]) << 1 | spread(run.x[2][i]);
        keys[i] = isLong[i] ? unused : place << indexBits | (first + i);
        if (isLong[i]) longOnes.push_back(std::uint32_t(first + i));
    }
}

// Adds the keys of the parts that have none yet; the long ones among them are returned in order.
std::vector<std::uint32_t> addKeys(const Parts& parts, const glm::ivec3& size, std::vector<std::uint64_t>& keys,
                                   Progress* progress) {
    const std::size_t begin = keys.size();
    keys.resize(parts.count());
    tbb::enumerable_thread_specific<std::vector<std::uint32_t>> found;
    const std::size_t runs = (keys.size() - begin + Cells::most - 1) / Cells::most;
    forAll(runs, progress, [&](std::size_t run) {
        const std::size_t first = begin + run * Cells::most, count = std::min(Cells::most, keys.size() - first);
        makeKeys(parts, size, first, count, keys.data() + first, found.local());
    });
    std::vector<std::uint32_t> longOnes;
    for (const auto& some : found) longOnes.insert(longOnes.end(), some.begin(), some.end());
    std::sort(longOnes.begin(), longOnes.end());
    return longOnes;
}

// In no particular order.
std::vector<std::uint64_t> keysOf(Parts& parts, const glm::ivec3& size, Progress* progress) {
    std::vector<std::uint64_t> keys;
    const std::vector<std::uint32_t> longOnes = addKeys(parts, size, keys, progress);
    if (!longOnes.empty()) {
        for (const std::size_t i : Polled(longOnes.size(), progress)) parts.halve(longOnes[i]);
        addKeys(parts, size, keys, progress);
        std::erase(keys, unused);
    }
    return keys;
}

// Puts parts into an order of their own: halves by the middle of the longest side of where they are, those halved
// again, and so on, each in full groups as the tree has them.
class Splitter {
  public:
    Splitter(const Parts& parts, std::vector<std::uint64_t>& keys, Progress* progress)
        : keys_(keys), items_(vectorOf<Item>(keys.size(), progress)), progress_(progress) {
        forAll(keys.size(), progress, [&](std::size_t i) {
            const Corners c = parts.corners(std::size_t(keys[i] & indexMask));
            items_[i] = {glm::vec3(c[0] + c[1] + c[2]), std::uint32_t(keys[i] & indexMask)};
        });
    }

    void sort() {
        std::size_t size = treeWidth;  // parts of a child
        while (size * treeWidth < items_.size()) size *= treeWidth;
        split(0, items_.size(), size);
        forAll(keys_.size(), progress_, [&](std::size_t i) { keys_[i] = items_[i].part; });
    }

  private:
    struct Item {
        glm::vec3 place;
        std::uint32_t part;
    };

    using Whole [[gnu::vector_size(sizeof(Item))]] = float;

    static Whole wholeOf(const Item* item) {
        Whole whole;
        std::memcpy(&whole, item, sizeof whole);
        return whole;
    }

    static bool less(const Item& a, const Item& b, int axis) {
        const float x = a.place[axis], y = b.place[axis];
        return bool(int(x < y) | (int(x == y) & int(a.part < b.part)));
    }

    // As std::nth_element, but without branches on what can not be foretold.
    static void select(Item* begin, Item* middle, Item* end, int axis) {
        const auto inOrder = [axis](const Item& a, const Item& b) { return less(a, b, axis); };
        for (int round = 0; round < mostRounds && end - begin > shortRun; ++round) {
            // all differ: something is less than the second of three
            std::array<Item, 3> some{*begin, begin[(end - begin) / 2], end[-1]};
            std::sort(some.begin(), some.end(), inOrder);
            Item* store = begin;
            for (Item* i = begin; i < end; ++i) {
                // as wholes: what is written in pieces can not be read at once soon after
                const bool before = less(*i, some[1], axis);
                const Whole here = wholeOf(i), there = wholeOf(store);
                std::memcpy(i, &there, sizeof there);
                std::memcpy(store, &here, sizeof here);
                store += before;
            }
            (middle < store ? end : begin) = store;
        }
        std::nth_element(begin, middle, end, inOrder);
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
        if (end - begin > runLength)
            tbb::parallel_invoke(left, right);
        else
            left(), right();
    }

    std::vector<std::uint64_t>& keys_;
    std::vector<Item> items_;
    Progress* progress_;
};

// A unit vector across `direction`.
glm::dvec3 across(const glm::dvec3& direction) {
    const glm::dvec3 a = glm::abs(direction);
    const glm::dvec3 least(a.x <= a.y && a.x <= a.z, a.y < a.x && a.y <= a.z, a.z < a.x && a.z < a.y);
    return glm::normalize(glm::cross(direction, least));
}

template <class Vector>
Vector unitOr(const Vector& v, const Vector& otherwise) {
    const double length2 = glm::dot(v, v);
    return length2 > 0 ? v * (1 / std::sqrt(length2)) : otherwise;
}

// Writes a triangle in its frame; one without an area becomes a segment or a point.
void writeTriangle(WideLeaf& leaf, std::size_t place, const Corners& corners) {
    // x along the longest edge, z straightened up from it: a sliver's normal is mostly rounding, but whatever is left
    // of it then tilts the sliver about its own length
    const Corners edges{corners[1] - corners[0], corners[2] - corners[1], corners[0] - corners[2]};
    const auto shorter = [](const glm::dvec3& p, const glm::dvec3& q) { return glm::dot(p, p) < glm::dot(q, q); };
    const auto first = std::size_t(std::max_element(edges.begin(), edges.end(), shorter) - edges.begin());
    const glm::dvec3 &a = corners[first], &b = corners[(first + 1) % 3], &c = corners[(first + 2) % 3];
    const glm::dvec3 x = unitOr(b - a, glm::dvec3(1, 0, 0));
    const glm::dvec3 normal = unitOr(glm::cross(b - a, c - a), glm::dvec3(0)),
                     upright = normal - glm::dot(normal, x) * x;
    const glm::dvec3 z = glm::dot(upright, upright) > 0.25 ? glm::normalize(upright) : across(x), y = glm::cross(z, x);
    const glm::dvec2 flatB(glm::dot(b - a, x), 0), flatC(glm::dot(c - a, x), glm::dot(c - a, y));
    const glm::dvec2 bc = unitOr(flatC - flatB, glm::dvec2(1, 0)), ac = unitOr(flatC, glm::dvec2(1, 0));
    const glm::dvec3 cell = glm::floor(a);
    for (int i = 0; i < 3; ++i) {
        leaf.cell[i][place] = float(cell[i]);
        leaf.corner[i][place] = float(a[i] - cell[i]);
        leaf.normal[i][place] = float(z[i]);
        leaf.along[i][place] = float(x[i]);
    }
    for (int i = 0; i < 2; ++i) {
        leaf.directionBC[i][place] = float(bc[i]);
        leaf.directionAC[i][place] = float(ac[i]);
    }
    leaf.lengthAB[place] = float(flatB.x);
    leaf.lengthBC[place] = float(glm::length(flatC - flatB));
    leaf.lengthAC[place] = float(glm::length(flatC));
}

void setBox(BoxGroup& group, std::size_t place, const glm::vec3& lower, const glm::vec3& upper) {
    for (int i = 0; i < 3; ++i) {
        group.lower[i][place] = lower[i];
        group.upper[i][place] = upper[i];
    }
}

float below(double x) {
    const float f = float(x);
    return double(f) > x ? std::nextafter(f, -std::numeric_limits<float>::infinity()) : f;
}

void makeLeaf(const Parts& parts, const std::vector<std::uint64_t>& keys, std::size_t index, WideTree& tree) {
    const std::size_t begin = index * treeWidth, count = std::min<std::size_t>(treeWidth, keys.size() - begin);
    const auto partAt = [&](std::size_t i) { return std::size_t(keys[std::min(i, keys.size() - 1)] & indexMask); };
    for (std::size_t i = begin; i < begin + treeWidth; ++i) {
        parts.fetchIndices(partAt(i + 4 * treeWidth));
        parts.fetchCorners(partAt(i + 2 * treeWidth));
    }
    std::array<Corners, treeWidth> corners;
    WideLeaf& leaf = tree.leaves[index];
    Box box;
    for (std::size_t i = 0; i < treeWidth; ++i) {
        const std::size_t part = partAt(begin + std::min(i, count - 1));
        corners[i] = parts.corners(part);
        leaf.triangles[i] = parts.triangle(part);
        for (const glm::dvec3& corner : corners[i]) box.add(corner);
    }
    for (std::size_t i = 0; i < treeWidth; ++i) writeTriangle(leaf, i, corners[i]);
    setBox(tree.groups[index / treeWidth], index % treeWidth,
           {below(box.lower.x), below(box.lower.y), below(box.lower.z)},
           {-below(-box.upper.x), -below(-box.upper.y), -below(-box.upper.z)});
}

// The box around the boxes of a group becomes one box of its parent.
void joinBoxes(const BoxGroup& group, BoxGroup& parent, std::size_t place) {
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

void makeGroups(WideTree& tree, Progress* progress) {
    std::uint32_t begin = 0, children = tree.leafCount, firstChild = 0;  // of the level below
    for (;;) {
        const std::uint32_t count = (children + treeWidth - 1) / treeWidth;
        for (std::uint32_t i = 0; i < count; ++i) tree.groups[begin + i].firstChild = firstChild + i * treeWidth;
        emptyBoxes(tree.groups[begin + count - 1], children - (count - 1) * treeWidth);
        if (count == 1) return;
        forAll(count, progress, [&](std::size_t i) {
            joinBoxes(tree.groups[begin + i], tree.groups[begin + count + i / treeWidth], i % treeWidth);
        });
        firstChild = tree.leafCount + begin;
        begin += count;
        children = count;
    }
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

WideTree makeWideTree(const Mesh& mesh, float voxelSize, Progress* progress, const TreeShape& shape) {
    if (mesh.triangles.size() >= (std::size_t(1) << indexBits))
        throw std::invalid_argument("the mesh has 2^28 triangles or more");
    const Bounds box = bounds(mesh);
    const glm::dvec3 lower = glm::dvec3(box.lower) / double(voxelSize),
                     upper = glm::dvec3(box.upper) / double(voxelSize);
    const glm::dvec3 base = 8.0 * glm::floor(lower / 8.0), size = glm::floor(upper - base) + 1.0;
    if (!(std::max({size.x, size.y, size.z}) <= longestMesh))
        throw std::invalid_argument("voxelSize is too small: the mesh is longer than 2^23 voxels");
    WideTree tree;
    tree.base = glm::ivec3(base);
    tree.size = glm::ivec3(size);

    Parts parts(mesh, base, voxelSize, shape.longestEdge);
    std::vector<std::uint64_t> keys = keysOf(parts, tree.size, progress);
    if (shape.order == TreeOrder::split)
        Splitter(parts, keys, progress).sort();
    else
        sortKeys(keys, progress);
    tree.leafCount = std::uint32_t((keys.size() + treeWidth - 1) / treeWidth);
    tree.groupCount = groupsOver(tree.leafCount);
    tree.leaves = LargeArray<WideLeaf>(tree.leafCount);
    tree.groups = LargeArray<BoxGroup>(tree.groupCount);
    forAll(tree.leafCount, progress, [&](std::size_t i) { makeLeaf(parts, keys, i, tree); });
    makeGroups(tree, progress);
    return tree;
}

}  // namespace bilayer
