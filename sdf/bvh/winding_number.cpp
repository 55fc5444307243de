// SPDX-License-Identifier: Apache-2.0
#include "sdf/bvh/winding_number.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/gtc/constants.hpp>
#include <limits>
#include <span>

#include "sdf/base/progress.h"
#include "sdf/bvh/median_tree.h"
#include "sdf/bvh/solid_angle.h"

namespace bilayer::detail {
namespace {

constexpr std::size_t leafTriangles = 12;
/// An expansion with a larger error bound is not used: the node is opened. This also keeps the sums of errors accurate.
constexpr double uselessError = 10;
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

}  // namespace

struct WindingNumber::Item {
    glm::vec3 at;
    std::uint32_t index;
};

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
    nodes_ = vectorOf<Node>(medianTreeNodes(count, leafTriangles), progress);
    triangles_ = vectorOf<Corners>(count, progress);
    // Corners are copied once the ranges are final. The sums of a node follow from those of its children.
    struct Builder {
        WindingNumber& tree;
        const Mesh& mesh;
        std::vector<Item>& items;
        Progress* progress;
        Bounds operator()(std::size_t at, std::size_t begin, std::size_t end) const {
            Node& node = tree.nodes_[at];
            node.begin = std::uint32_t(begin);
            node.end = std::uint32_t(end);
            if (end - begin <= leafTriangles) {
                std::sort(items.begin() + std::ptrdiff_t(begin), items.begin() + std::ptrdiff_t(end),
                          [](const Item& a, const Item& b) { return a.index < b.index; });
                for (std::size_t i = begin; i < end; ++i) {
                    const glm::uvec3 t = mesh.triangles[items[i].index];
                    tree.triangles_[i] = {mesh.points[t.x], mesh.points[t.y], mesh.points[t.z]};
                }
                node.right = 0;
                return tree.sumTriangles(node);
            }
            const std::size_t middle = splitAtMedian(items, begin, end, progress), left = at + 1;
            const std::size_t right = left + medianTreeNodes(middle - begin, leafTriangles);
            node.right = std::uint32_t(right);
            Bounds box, other;
            buildChildren(
                end - begin, [&] { box = (*this)(left, begin, middle); }, [&] { other = (*this)(right, middle, end); });
            box.add(other.lower);
            box.add(other.upper);
            tree.sumChildren(node, tree.nodes_[left], tree.nodes_[right], box);
            return box;
        }
    };
    Builder{*this, mesh, items, progress}(0, 0, count);
}

Bounds WindingNumber::sumTriangles(Node& node) const {
    const std::span triangles(triangles_.data() + node.begin, triangles_.data() + node.end);
    glm::dvec3 weighted(0), plain(0);
    node.total = 0;
    node.area = glm::dvec3(0);
    for (const Corners& t : triangles) {
        const glm::dvec3 a(t[0]), b(t[1]), c(t[2]), n = 0.5 * glm::cross(b - a, c - a), middle = (a + b + c) / 3.0;
        node.total += glm::length(n);
        node.area += n;
        weighted += glm::length(n) * middle;
        plain += middle;
    }
    node.centre = node.total > 0 ? weighted / node.total : plain / double(triangles.size());
    node.radius = node.spread = 0;
    node.moment = {};
    node.moment2 = {};
    Bounds box;
    for (const Corners& t : triangles) {
        const glm::dvec3 a = glm::dvec3(t[0]) - node.centre, b = glm::dvec3(t[1]) - node.centre,
                         c = glm::dvec3(t[2]) - node.centre;
        const glm::dvec3 n = 0.5 * glm::cross(b - a, c - a), s = (a + b + c) / 3.0;
        node.radius = std::max({node.radius, glm::length(a), glm::length(b), glm::length(c)});
        // The integral of x x^T over a triangle: area / 12 (a a^T + b b^T + c c^T + 9 s s^T).
        Symmetric2 second{};
        for (const glm::dvec3& corner : {a, b, c}) add(second, product(corner, corner), 1.0 / 12);
        add(second, product(s, s), 9.0 / 12);
        node.spread += glm::length(n) * (second[0] + second[1] + second[2]);
        add(node.moment, product(s, n));
        add(node.moment2, product(second, n));
        for (const glm::vec3& corner : t) box.add(corner);
    }
    return box;
}

void WindingNumber::sumChildren(Node& node, const Node& left, const Node& right, const Bounds& box) const {
    node.total = left.total + right.total;
    node.centre = node.total > 0 ? (left.total * left.centre + right.total * right.centre) / node.total
                                 : 0.5 * (left.centre + right.centre);
    node.area = left.area + right.area;
    node.moment = {};
    node.moment2 = {};
    node.spread = 0;
    double radius = 0;
    for (const Node* child : {&left, &right}) {
        const glm::dvec3 s = child->centre - node.centre;
        radius = std::max(radius, glm::length(s) + child->radius);
        node.spread += child->spread + child->total * glm::dot(s, s);
        add(node.moment, child->moment);
        add(node.moment, product(s, child->area));
        add(node.moment2, child->moment2);
        add(node.moment2, product(child->moment, s), 2);
        add(node.moment2, product(product(s, s), child->area));
    }
    const glm::dvec3 corner = glm::max(node.centre - glm::dvec3(box.lower), glm::dvec3(box.upper) - node.centre);
    node.radius = std::min(radius, glm::length(corner));
}

double WindingNumber::solidAngles(const Node& node, const glm::dvec3& point) const {
    double angle = 0;
    for (std::uint32_t i = node.begin; i < node.end; ++i) {
        const Corners& t = triangles_[i];
        angle += solidAngle(glm::dvec3(t[0]) - point, glm::dvec3(t[1]) - point, glm::dvec3(t[2]) - point).value;
    }
    return angle / (4 * glm::pi<double>());
}

// The kernel n . (x - q) / |x - q|^3 is expanded in s = x - centre to second order. The term of order k - 1 is the
// gradient of a solid harmonic of degree k, at most k |s|^(k - 1) / R^(k + 1) (Bernstein's inequality), with R =
// |centre - q|. For |s| <= t R the truncated terms sum to at most t |s|^2 / R^4 (4 - 3 t) / (1 - t)^2.
WindingNumber::Estimate WindingNumber::expansion(const Node& node, const glm::dvec3& point) const {
    const glm::dvec3 toCentre = node.centre - point;
    const double squared = glm::dot(toCentre, toCentre), distance = std::sqrt(squared);
    if (!(node.radius < distance)) return {0, std::numeric_limits<double>::infinity()};
    const double t = node.radius / distance, unit = 1 / (4 * glm::pi<double>() * squared);
    const double error = unit * node.spread / squared * t * (4 - 3 * t) / ((1 - t) * (1 - t));
    if (!(error < uselessError)) return {0, error};
    const glm::dvec3 u = toCentre / distance;
    const Symmetric2& m = node.moment;
    const double along = m[0] * u.x * u.x + m[1] * u.y * u.y + m[2] * u.z * u.z +
                         2 * (m[3] * u.x * u.y + m[4] * u.y * u.z + m[5] * u.z * u.x);
    const double first = (m[0] + m[1] + m[2] - 3 * along) / distance;
    const double second = (7.5 * cubic(node.moment2, u) - 4.5 * trace(node.moment2, u)) / squared;
    return {unit * (glm::dot(node.area, u) + first + second), error};
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
            const Node& node = nodes_[at];
            const Estimate far = expansion(node, point);
            if (far.error < uselessError) {
                sum.value += far.value;
                sum.error += far.error;
                heap.push_back({far, at});
                std::push_heap(heap.begin(), heap.end());
            } else
                refine(node, at, point, sum, open);
        }
        if (heap.empty()) return {sum.value, 0};
        if (sum.error < share * std::abs(sum.value - 0.5)) return {sum.value, std::max(sum.error, 0.0)};
        std::pop_heap(heap.begin(), heap.end());
        const Far worst = heap.back();
        heap.pop_back();
        sum.value -= worst.estimate.value;
        sum.error -= worst.estimate.error;
        refine(nodes_[worst.node], worst.node, point, sum, open);
    }
}

// A first estimate bounds the true number's difference from 1/2. The second one then has an error below a half.
int WindingNumber::nearestInteger(const glm::dvec3& point) const {
    const Estimate first = estimate(point, onlySide);
    const double range = std::abs(first.value - 0.5) + first.error;
    const Estimate second = first.error < surelyNearest ? first : estimate(point, surelyNearest / (range + 1));
    return int(std::lround(second.value));
}

void WindingNumber::refine(const Node& node, std::uint32_t at, const glm::dvec3& point, Estimate& sum,
                           std::vector<std::uint32_t>& open) const {
    if (node.right == 0)
        sum.value += solidAngles(node, point);
    else {
        open.push_back(node.right);
        open.push_back(at + 1);
    }
}

bool WindingNumber::meets(const glm::dvec3& from, const glm::dvec3& to) const {
    const glm::dvec3 middle = 0.5 * (from + to);
    const double half = 0.5 * glm::length(to - from) * (1 + 1e-9);
    std::vector<std::uint32_t> open{0};
    while (!open.empty()) {
        const std::uint32_t at = open.back();
        open.pop_back();
        const Node& node = nodes_[at];
        if (glm::length(node.centre - middle) > node.radius * (1 + 1e-9) + half) continue;
        if (node.right != 0) {
            open.push_back(node.right);
            open.push_back(at + 1);
            continue;
        }
        for (std::uint32_t i = node.begin; i < node.end; ++i)
            if (segmentMeets(from, to, triangles_[i])) return true;
    }
    return false;
}

}  // namespace bilayer::detail
