// SPDX-License-Identifier: Apache-2.0
#include "sdf/bvh/winding_number.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/constants.hpp>
#include <span>

#include "sdf/base/progress.h"
#include "sdf/bvh/median_tree.h"
#include "sdf/bvh/solid_angle.h"

namespace bilayer::detail {
namespace {

constexpr std::size_t leafTriangles = 12;
/// Errors that a cluster may have: at first, by how much less in each further try, and the rounding of the sum.
constexpr double coarsest = 0.01, refinement = 16, finest = 1e-13;
/// An estimate of an integer with a smaller error rounds to it: a half, less a margin for rounding.
constexpr double surelyNearest = 0.49;

double determinant(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c) {
    return glm::dot(a, glm::cross(b, c));
}

// Touching counts as an intersection. The determinants of a shared edge are exact negatives of each other, so no
// segment passes between two triangles.
bool segmentMeets(const glm::dvec3& from, const glm::dvec3& to, const std::array<glm::vec3, 3>& corners) {
    const glm::dvec3 segment = to - from;
    const glm::dvec3 a = glm::dvec3(corners[0]) - from, b = glm::dvec3(corners[1]) - from,
                     c = glm::dvec3(corners[2]) - from;
    const double ab = glm::dot(segment, glm::cross(a, b)), bc = glm::dot(segment, glm::cross(b, c)),
                 ca = glm::dot(segment, glm::cross(c, a));
    if (!((ab >= 0 && bc >= 0 && ca >= 0) || (ab <= 0 && bc <= 0 && ca <= 0))) return false;
    const double start = determinant(a, b, c), end = determinant(a - segment, b - segment, c - segment);
    return !((start > 0 && end > 0) || (start < 0 && end < 0));
}

/// A triangle with its middle [m].
struct Item {
    glm::vec3 at;
    std::uint32_t index;
};

}  // namespace

WindingNumber::WindingNumber(const Mesh& mesh, Progress* progress) {
    validate(mesh);
    const std::size_t count = mesh.triangles.size();
    auto items = vectorOf<Item>(count, progress);
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, medianTreeTask), [&](const auto& range) {
        for (std::size_t i = range.begin(); i < range.end(); ++i) {
            const glm::uvec3 t = mesh.triangles[i];
            items[i] = {(mesh.points[t.x] + mesh.points[t.y] + mesh.points[t.z]) / 3.f, std::uint32_t(i)};
        }
    });
    triangles_ = vectorOf<Corners>(count, progress);
    auto boxes = vectorOf<Bounds>(Tree::nodeCount(count, leafTriangles), progress);
    const auto split = [&](std::size_t begin, std::size_t middle, std::size_t end) {
        splitAtMedian(std::span(items).subspan(begin, end - begin), middle - begin, progress);
    };
    // Corners are copied once the ranges are final. The sums of a node follow from those of its children.
    const auto summarise = [&](std::uint32_t at) {
        const Node& node = tree_[at];
        Bounds& box = boxes[at];
        if (!tree_.isLeaf(at)) {
            const std::uint32_t first = tree_.first(at), second = tree_.second(at);
            for (const std::uint32_t child : {first, second}) {
                box.add(boxes[child].lower);
                box.add(boxes[child].upper);
            }
            return WindingCluster(tree_[first], tree_[second], box);
        }
        const auto own = std::span(items).subspan(node.begin, node.end - node.begin);
        std::sort(own.begin(), own.end(), [](const Item& a, const Item& b) { return a.index < b.index; });
        const std::span<Corners> triangles(triangles_.data() + node.begin, own.size());
        for (std::size_t i = 0; i < own.size(); ++i) {
            const glm::uvec3 t = mesh.triangles[own[i].index];
            triangles[i] = {mesh.points[t.x], mesh.points[t.y], mesh.points[t.z]};
            for (const glm::vec3& corner : triangles[i]) box.add(corner);
        }
        return WindingCluster(triangles);
    };
    tree_.build(count, leafTriangles, split, summarise, progress);
}

double WindingNumber::solidAngles(const Node& node, const glm::dvec3& point) const {
    double angle = 0;
    for (std::uint32_t i = node.begin; i < node.end; ++i) {
        const Corners& t = triangles_[i];
        angle += solidAngle(glm::dvec3(t[0]) - point, glm::dvec3(t[1]) - point, glm::dvec3(t[2]) - point).value;
    }
    return angle / (4 * glm::pi<double>());
}

WindingNumber::Estimate WindingNumber::estimate(const glm::dvec3& point, double share) const {
    struct Far {
        Estimate estimate;
        std::uint32_t node;
        bool operator<(const Far& other) const { return estimate.error < other.estimate.error; }
    };
    Estimate sum{0, 0};
    std::vector<Far> heap;  // clusters that currently represent their triangles, the largest error on top
    std::vector<std::uint32_t> open{0};
    for (;;) {
        while (!open.empty()) {
            const std::uint32_t at = open.back();
            open.pop_back();
            const Estimate far = tree_[at].expansion(point);
            if (far.error < WindingCluster::uselessError) {
                sum.value += far.value;
                sum.error += far.error;
                heap.push_back({far, at});
                std::push_heap(heap.begin(), heap.end());
            } else
                refine(at, point, sum, open);
        }
        if (heap.empty()) return {sum.value, 0};
        if (sum.error < share * std::abs(sum.value - 0.5)) return {sum.value, std::max(sum.error, 0.0)};
        std::pop_heap(heap.begin(), heap.end());
        const Far worst = heap.back();
        heap.pop_back();
        sum.value -= worst.estimate.value;
        sum.error -= worst.estimate.error;
        refine(worst.node, point, sum, open);
    }
}

/// The sum over the triangles of a node. Each cluster that represents its triangles has an error below `maxError`.
WindingNumber::Estimate WindingNumber::sumOf(std::uint32_t at, const glm::dvec3& point, double maxError) const {
    const Estimate far = tree_[at].expansion(point);
    if (far.error < maxError) return far;
    if (tree_.isLeaf(at)) return {solidAngles(tree_[at], point), 0};
    const Estimate first = sumOf(tree_.first(at), point, maxError), second = sumOf(tree_.second(at), point, maxError);
    return {first.value + second.value, first.error + second.error};
}

bool WindingNumber::isInside(const glm::dvec3& point) const noexcept {
    for (double maxError = coarsest;; maxError = maxError > finest ? maxError / refinement : 0) {
        const Estimate sum = sumOf(0, point, maxError);
        if (maxError == 0 || sum.error < onlySide * std::abs(sum.value - 0.5)) return sum.value > 0.5;
    }
}

std::size_t WindingNumber::memoryBytes() const noexcept {
    return triangles_.size() * sizeof(Corners) + tree_.nodes().size_bytes();
}

// A first estimate bounds the true number's difference from 1/2. The second one then has an error below a half.
int WindingNumber::nearestInteger(const glm::dvec3& point) const {
    const Estimate first = estimate(point, onlySide);
    const double range = std::abs(first.value - 0.5) + first.error;
    const Estimate second = first.error < surelyNearest ? first : estimate(point, surelyNearest / (range + 1));
    return int(std::lround(second.value));
}

void WindingNumber::refine(std::uint32_t at, const glm::dvec3& point, Estimate& sum,
                           std::vector<std::uint32_t>& open) const {
    if (tree_.isLeaf(at))
        sum.value += solidAngles(tree_[at], point);
    else
        open.insert(open.end(), {tree_.second(at), tree_.first(at)});
}

bool WindingNumber::meets(const glm::dvec3& from, const glm::dvec3& to) const {
    const glm::dvec3 middle = 0.5 * (from + to);
    const double half = 0.5 * glm::length(to - from) * (1 + 1e-9);
    bool found = false;
    const auto isFar = [&](const Node& node) {
        return glm::length(node.centre - middle) > node.radius * (1 + 1e-9) + half;
    };
    tree_.forEachLeaf(isFar, [&](const Node& leaf) {
        for (std::uint32_t i = leaf.begin; i < leaf.end && !found; ++i) found = segmentMeets(from, to, triangles_[i]);
        return !found;
    });
    return found;
}

}  // namespace bilayer::detail
