// SPDX-License-Identifier: Apache-2.0
#include "sdf/bvh/wide_tree.h"

#include <hwy/cache_control.h>
#include <oneapi/tbb/enumerable_thread_specific.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <stdexcept>
#include <utility>

#include "sdf/base/perpendicular.h"
#include "sdf/base/polled_loop.h"
#include "sdf/base/triangle_corners.h"

namespace bilayer::detail {
namespace {

/// Floats represent all integers up to twice this [voxels].
constexpr double maxMeshVoxels = 1 << 23;

struct DoubleBounds {
    glm::dvec3 lower{std::numeric_limits<double>::infinity()}, upper{-std::numeric_limits<double>::infinity()};

    void add(const glm::dvec3& p) { lower = glm::min(lower, p), upper = glm::max(upper, p); }
};

// The items of the tree: triangles that are short enough, and the parts of longer ones.
class TriangleParts {
  public:
    TriangleParts(const Mesh& mesh, const glm::dvec3& base, double voxelSize, double longestEdge)
        : mesh_(mesh), base_(base), perVoxelSize_(1 / voxelSize), longest2_(longestEdge * longestEdge) {}

    TriangleCorners corners(std::size_t part) const {
        return part < mesh_.triangles.size() ? ofTriangle(part) : halves_[part - mesh_.triangles.size()].corners;
    }
    std::uint32_t triangle(std::size_t part) const {
        return part < mesh_.triangles.size() ? std::uint32_t(part) : halves_[part - mesh_.triangles.size()].triangle;
    }
    // Prefetches memory ahead of its use, because the order of parts is random in the mesh.
    void fetchIndices(std::size_t part) const {
        if (part < mesh_.triangles.size()) hwy::Prefetch(&mesh_.triangles[part]);
    }
    void fetchCorners(std::size_t part) const {
        if (part >= mesh_.triangles.size()) return;
        for (int i = 0; i < 3; ++i) hwy::Prefetch(&mesh_.points[mesh_.triangles[part][i]]);
    }
    std::size_t count() const { return mesh_.triangles.size() + halves_.size(); }

    // Returns the longest edge, from this corner to the next, and its squared length.
    static std::pair<std::size_t, double> longest(const TriangleCorners& c) {
        const auto length2 = [&](std::size_t i) {
            const glm::dvec3 edge = c[(i + 1) % 3] - c[i];
            return glm::dot(edge, edge);
        };
        const std::array<double, 3> all{length2(0), length2(1), length2(2)};
        const auto edge = std::size_t(std::max_element(all.begin(), all.end()) - all.begin());
        return {edge, all[edge]};
    }
    bool isLong(const TriangleCorners& c) const { return longest(c).second > longest2_; }

    void halve(std::uint32_t triangle) { halve(ofTriangle(triangle), triangle); }

  private:
    struct Half {
        TriangleCorners corners;
        std::uint32_t triangle;
    };

    TriangleCorners ofTriangle(std::size_t index) const {
        const glm::uvec3& t = mesh_.triangles[index];
        return {local(t.x), local(t.y), local(t.z)};
    }
    glm::dvec3 local(unsigned point) const { return glm::dvec3(mesh_.points[point]) * perVoxelSize_ - base_; }

    void halve(const TriangleCorners& c, std::uint32_t triangle) {
        const auto [i, length2] = longest(c);
        if (length2 <= longest2_) {
            if (count() >= maxOnCurve)
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

/// The key of an unused part.
constexpr std::uint64_t unused = ~std::uint64_t(0);

// Computes the keys of parts first .. first + count - 1. Long triangles get no key and are recorded in `longOnes`.
void makeKeys(const TriangleParts& parts, const glm::ivec3& size, std::size_t first, std::size_t count,
              std::uint64_t* keys, std::vector<std::uint32_t>& longOnes) {
    constexpr double cells = curveCells;
    const double scale = cells / (3.0 * std::max({size.x, size.y, size.z}));
    CurveCells run{};
    std::array<bool, CurveCells::capacity> isLong{};
    for (std::size_t i = 0; i < count; ++i) {
        const TriangleCorners c = parts.corners(first + i);
        for (int k = 0; k < 3; ++k)
            run.x[k][i] = std::uint32_t(std::clamp((c[0][k] + c[1][k] + c[2][k]) * scale, 0.0, cells - 1));
        isLong[i] = parts.isLong(c);
    }
    makeCurveKeys(run, first, count, keys);
    for (std::size_t i = 0; i < count; ++i) {
        if (isLong[i]) keys[i] = unused;
        if (isLong[i]) longOnes.push_back(std::uint32_t(first + i));
    }
}

// Adds the keys of parts that have none yet. Returns the long ones among these in order.
std::vector<std::uint32_t> addKeys(const TriangleParts& parts, const glm::ivec3& size, std::vector<std::uint64_t>& keys,
                                   Progress* progress) {
    const std::size_t begin = keys.size();
    keys.resize(parts.count());
    tbb::enumerable_thread_specific<std::vector<std::uint32_t>> found;
    const std::size_t runs = (keys.size() - begin + CurveCells::capacity - 1) / CurveCells::capacity;
    forAllPolled(runs, progress, [&](std::size_t run) {
        const std::size_t first = begin + run * CurveCells::capacity,
                          count = std::min(CurveCells::capacity, keys.size() - first);
        makeKeys(parts, size, first, count, keys.data() + first, found.local());
    });
    std::vector<std::uint32_t> longOnes;
    for (const auto& some : found) longOnes.insert(longOnes.end(), some.begin(), some.end());
    std::sort(longOnes.begin(), longOnes.end());
    return longOnes;
}

// Returns the keys of all parts in no particular order.
std::vector<std::uint64_t> keysOf(TriangleParts& parts, const glm::ivec3& size, Progress* progress) {
    std::vector<std::uint64_t> keys;
    const std::vector<std::uint32_t> longOnes = addKeys(parts, size, keys, progress);
    if (!longOnes.empty()) {
        for (const std::size_t i : Polled(longOnes.size(), progress)) parts.halve(longOnes[i]);
        addKeys(parts, size, keys, progress);
        std::erase(keys, unused);
    }
    return keys;
}

// Sorts the keys by recursive splitting instead of Hilbert order.
void split(const TriangleParts& parts, std::vector<std::uint64_t>& keys, Progress* progress) {
    auto items = vectorOf<TreeItem>(keys.size(), progress);
    forAllPolled(keys.size(), progress, [&](std::size_t i) {
        const TriangleCorners c = parts.corners(std::size_t(keys[i] & curveIndexMask));
        items[i] = {glm::vec3(c[0] + c[1] + c[2]), std::uint32_t(keys[i] & curveIndexMask)};
    });
    sortBySplitting(items, progress);
    forAllPolled(keys.size(), progress, [&](std::size_t i) { keys[i] = items[i].index; });
}

template <class Vector>
Vector unitOr(const Vector& v, const Vector& otherwise) {
    const double length2 = glm::dot(v, v);
    return length2 > 0 ? v * (1 / std::sqrt(length2)) : otherwise;
}

// Writes a triangle in its own frame. A triangle without area becomes a segment or a point.
void writeTriangle(WideLeaf& leaf, std::size_t place, const TriangleCorners& corners) {
    // x points along the longest edge, and z is made orthogonal to it. The normal of a sliver is mostly rounding error;
    // the remaining error then only tilts the sliver about its long axis
    const TriangleCorners edges{corners[1] - corners[0], corners[2] - corners[1], corners[0] - corners[2]};
    const auto shorter = [](const glm::dvec3& p, const glm::dvec3& q) { return glm::dot(p, p) < glm::dot(q, q); };
    const auto first = std::size_t(std::max_element(edges.begin(), edges.end(), shorter) - edges.begin());
    const glm::dvec3 &a = corners[first], &b = corners[(first + 1) % 3], &c = corners[(first + 2) % 3];
    const glm::dvec3 x = unitOr(b - a, glm::dvec3(1, 0, 0));
    const glm::dvec3 normal = unitOr(glm::cross(b - a, c - a), glm::dvec3(0)),
                     upright = normal - glm::dot(normal, x) * x;
    const glm::dvec3 z = glm::dot(upright, upright) > 0.25 ? glm::normalize(upright) : perpendicularTo(x),
                     y = glm::cross(z, x);
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

float below(double x) {
    const float f = float(x);
    return double(f) > x ? std::nextafter(f, -std::numeric_limits<float>::infinity()) : f;
}

void makeLeaf(const TriangleParts& parts, const std::vector<std::uint64_t>& keys, std::size_t index, WideTree& tree) {
    const std::size_t begin = index * treeWidth, count = std::min<std::size_t>(treeWidth, keys.size() - begin);
    const auto partAt = [&](std::size_t i) { return std::size_t(keys[std::min(i, keys.size() - 1)] & curveIndexMask); };
    for (std::size_t i = begin; i < begin + treeWidth; ++i) {
        parts.fetchIndices(partAt(i + 4 * treeWidth));
        parts.fetchCorners(partAt(i + 2 * treeWidth));
    }
    std::array<TriangleCorners, treeWidth> corners;
    WideLeaf& leaf = tree.leaves[index];
    DoubleBounds box;
    for (std::size_t i = 0; i < treeWidth; ++i) {
        const std::size_t part = partAt(begin + std::min(i, count - 1));
        corners[i] = parts.corners(part);
        leaf.triangles[i] = parts.triangle(part);
        for (const glm::dvec3& corner : corners[i]) box.add(corner);
    }
    for (std::size_t i = 0; i < treeWidth; ++i) writeTriangle(leaf, i, corners[i]);
    tree.setLeafBox(index, {below(box.lower.x), below(box.lower.y), below(box.lower.z)},
                    {-below(-box.upper.x), -below(-box.upper.y), -below(-box.upper.z)});
}

}  // namespace

WideTree makeWideTree(const Mesh& mesh, float voxelSize, Progress* progress, const TreeShape& shape) {
    if (mesh.triangles.size() >= maxOnCurve) throw std::invalid_argument("the mesh has 2^28 triangles or more");
    const Bounds box = bounds(mesh);
    const glm::dvec3 lower = glm::dvec3(box.lower) / double(voxelSize),
                     upper = glm::dvec3(box.upper) / double(voxelSize);
    const glm::dvec3 base = 8.0 * glm::floor(lower / 8.0), size = glm::floor(upper - base) + 1.0;
    if (!(std::max({size.x, size.y, size.z}) <= maxMeshVoxels))
        throw std::invalid_argument("voxelSize is too small: the mesh is longer than 2^23 voxels");
    WideTree tree;
    tree.base = glm::ivec3(base);
    tree.size = glm::ivec3(size);

    TriangleParts parts(mesh, base, voxelSize, shape.longestEdge);
    std::vector<std::uint64_t> keys = keysOf(parts, tree.size, progress);
    if (shape.order == TreeOrder::split)
        split(parts, keys, progress);
    else
        sortCurveKeys(keys, progress);
    tree.makeRoom((keys.size() + treeWidth - 1) / treeWidth);
    tree.leaves = LargeArray<WideLeaf>(tree.leafCount);
    forAllPolled(tree.leafCount, progress, [&](std::size_t i) { makeLeaf(parts, keys, i, tree); });
    tree.joinBoxes(progress);
    return tree;
}

}  // namespace bilayer::detail
