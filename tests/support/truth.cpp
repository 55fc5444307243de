// SPDX-License-Identifier: Apache-2.0
#include "tests/support/truth.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>

namespace bilayer::test {
namespace {

constexpr std::uint32_t leafTriangles = 4;  // fewer cost more boxes, more cost more triangles; flat optimum
// Relative error bounds of 2x2 and 3x3 determinants of differences, times the sum of their products' magnitudes: J. R.
// Shewchuk, "Adaptive Precision Floating-Point Arithmetic and Fast Robust Geometric Predicates", 1997, figs. 21 and 22,
// rounded up.
constexpr double planarRounding = 4e-16, spatialRounding = 1e-15;

// a mantissa of 113 bits holds the determinants of floats and voxel centres
__extension__ typedef __float128 Quadruple;

template <class Number>
Number cross(Number ax, Number ay, Number bx, Number by) {
    return ax * by - ay * bx;
}

// The side of the line a -> b in the x-y plane on which the point lies: > 0 left, 0 on it.
int planarSide(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& p) {
    const double left = (a.x - p.x) * (b.y - p.y), right = (a.y - p.y) * (b.x - p.x);
    if (std::abs(left - right) > planarRounding * (std::abs(left) + std::abs(right))) return left > right ? 1 : -1;
    using Q = Quadruple;
    const Q exact = cross(Q(a.x) - Q(p.x), Q(a.y) - Q(p.y), Q(b.x) - Q(p.x), Q(b.y) - Q(p.y));
    return exact > 0 ? 1 : exact < 0 ? -1 : 0;
}

template <class Number>
Number volume(const std::array<glm::dvec3, 3>& t, const glm::dvec3& p) {
    const auto at = [&](std::size_t i, int axis) { return Number(t[i][axis]) - Number(p[axis]); };
    return at(0, 2) * cross(at(1, 0), at(1, 1), at(2, 0), at(2, 1)) +
           at(1, 2) * cross(at(2, 0), at(2, 1), at(0, 0), at(0, 1)) +
           at(2, 2) * cross(at(0, 0), at(0, 1), at(1, 0), at(1, 1));
}

// The side of a triangle's plane on which the point lies: > 0 behind its front (the side from which it is
// counter-clockwise).
int spatialSide(const std::array<glm::dvec3, 3>& t, const glm::dvec3& p) {
    const auto product = [&](std::size_t i, std::size_t j, std::size_t k) {
        return std::abs(t[i].z - p.z) *
               (std::abs((t[j].x - p.x) * (t[k].y - p.y)) + std::abs((t[j].y - p.y) * (t[k].x - p.x)));
    };
    const double value = volume<double>(t, p);
    if (std::abs(value) > spatialRounding * (product(0, 1, 2) + product(1, 2, 0) + product(2, 0, 1)))
        return value > 0 ? 1 : -1;
    const Quadruple exact = volume<Quadruple>(t, p);
    return exact > 0 ? 1 : exact < 0 ? -1 : 0;
}

// The contribution of an edge to the winding number of a polygon around the point in the x-y plane: +-1 if it crosses
// the half-line towards +x. Edges own their lower end, so that a vertex on the half-line counts once. The reversed edge
// gives exactly the negative, because both directions end in the same call.
int planarCrossing(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& p) {
    if ((a.y > p.y) == (b.y > p.y)) return 0;
    if (a.y > b.y) return -planarCrossing(b, a, p);
    return planarSide(a, b, p) > 0 ? 1 : 0;
}

// +1 if the ray from the point towards +z leaves through the triangle's front, -1 if it enters.
int crossing(const std::array<glm::dvec3, 3>& t, const glm::dvec3& p) {
    const int shadow = planarCrossing(t[0], t[1], p) + planarCrossing(t[1], t[2], p) + planarCrossing(t[2], t[0], p);
    return shadow != 0 && shadow * spatialSide(t, p) > 0 ? shadow : 0;
}

glm::dvec3 closestOnSegment(const glm::dvec3& point, const glm::dvec3& a, const glm::dvec3& b) {
    const glm::dvec3 edge = b - a;
    const double squared = glm::dot(edge, edge);
    if (squared == 0) return a;
    return a + std::clamp(glm::dot(point - a, edge) / squared, 0.0, 1.0) * edge;
}

// Rounding may misplace the foot of the perpendicular on a sliver. So the foot is computed from weights that keep it in
// the triangle for any values, and the edges are always tested too. The result is never too small. It is too large by
// at most the width of a sliver that double precision cannot distinguish from a segment.
double squaredDistanceTo(const std::array<glm::dvec3, 3>& t, const glm::dvec3& point) {
    const auto squared = [&](const glm::dvec3& q) { return glm::dot(point - q, point - q); };
    double nearest = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < 3; ++i)
        nearest = std::min(nearest, squared(closestOnSegment(point, t[i], t[(i + 1) % 3])));

    const glm::dvec3 normal = glm::cross(t[1] - t[0], t[2] - t[0]);
    glm::dvec3 weights;
    for (int i = 0; i < 3; ++i) {
        const glm::dvec3 &a = t[std::size_t(i + 1) % 3], &b = t[std::size_t(i + 2) % 3];
        weights[i] = glm::dot(glm::cross(b - a, point - a), normal);
    }
    const double sum = weights.x + weights.y + weights.z;
    if (!(weights.x >= 0 && weights.y >= 0 && weights.z >= 0 && sum > 0)) return nearest;
    weights /= sum;
    return std::min(nearest, squared(weights.x * t[0] + weights.y * t[1] + weights.z * t[2]));
}

double squaredDistanceToBox(const glm::dvec3& lower, const glm::dvec3& upper, const glm::dvec3& point) {
    const glm::dvec3 gap = glm::max(glm::max(lower - point, point - upper), glm::dvec3(0));
    return glm::dot(gap, gap);
}

}  // namespace

Truth::Truth(const Mesh& mesh) {
    validate(mesh);
    triangles_.reserve(mesh.triangles.size());
    for (const auto& t : mesh.triangles)
        triangles_.push_back(
            {glm::dvec3(mesh.points[t.x]), glm::dvec3(mesh.points[t.y]), glm::dvec3(mesh.points[t.z])});
    nodes_.reserve(2 * triangles_.size());
    addNode(0, std::uint32_t(triangles_.size()));
}

void Truth::addNode(std::uint32_t begin, std::uint32_t end) {
    const std::size_t index = nodes_.size();
    Node node{glm::dvec3(std::numeric_limits<double>::max()), glm::dvec3(std::numeric_limits<double>::lowest()), begin,
              end, std::uint32_t(index + 1)};
    for (std::uint32_t i = begin; i < end; ++i)
        for (const auto& corner : triangles_[i]) {
            node.lower = glm::min(node.lower, corner);
            node.upper = glm::max(node.upper, corner);
        }
    nodes_.push_back(node);
    if (end - begin <= leafTriangles) return;  // `after` is already correct

    // splitting at the median along the longest side keeps the tree balanced for any mesh
    const glm::dvec3 size = node.upper - node.lower;
    const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
    const std::uint32_t middle = begin + (end - begin) / 2;
    std::nth_element(triangles_.begin() + begin, triangles_.begin() + middle, triangles_.begin() + end,
                     [axis](const Triangle& a, const Triangle& b) {
                         return a[0][axis] + a[1][axis] + a[2][axis] < b[0][axis] + b[1][axis] + b[2][axis];
                     });
    addNode(begin, middle);
    addNode(middle, end);
    nodes_[index].after = std::uint32_t(nodes_.size());
}

void Truth::search(std::uint32_t index, const glm::dvec3& point, double& squared) const {
    const Node& node = nodes_[index];
    if (node.after == index + 1) {
        for (std::uint32_t i = node.begin; i < node.end; ++i)
            squared = std::min(squared, squaredDistanceTo(triangles_[i], point));
        return;
    }
    const auto gapTo = [&](std::uint32_t child) {
        return squaredDistanceToBox(nodes_[child].lower, nodes_[child].upper, point);
    };
    std::uint32_t near = index + 1, far = nodes_[near].after;
    double nearGap = gapTo(near), farGap = gapTo(far);
    if (farGap < nearGap) {
        std::swap(near, far);
        std::swap(nearGap, farGap);
    }
    if (nearGap < squared) search(near, point, squared);
    if (farGap < squared) search(far, point, squared);
}

double Truth::distance(const glm::dvec3& point) const {
    double squared = std::numeric_limits<double>::infinity();
    search(0, point, squared);
    return std::sqrt(squared);
}

int Truth::winding(const glm::dvec3& point) const {
    // the surface crosses a ray towards +z where a triangle's projection on the x-y plane winds around the point, and
    // the triangle lies above it
    int result = 0;
    for (std::uint32_t n = 0; n < nodes_.size();) {
        const Node& node = nodes_[n];
        if (point.x < node.lower.x || point.x > node.upper.x || point.y < node.lower.y || point.y > node.upper.y ||
            point.z > node.upper.z) {
            n = node.after;
            continue;
        }
        if (node.after == ++n)
            for (std::uint32_t i = node.begin; i < node.end; ++i) result += crossing(triangles_[i], point);
    }
    return result;
}

double Truth::signedDistance(const glm::dvec3& point) const {
    return winding(point) > 0 ? -distance(point) : distance(point);
}

}  // namespace bilayer::test
