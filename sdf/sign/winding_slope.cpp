// SPDX-License-Identifier: Apache-2.0
#include "sdf/sign/winding_slope.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/constants.hpp>
#include <limits>
#include <span>

#include "sdf/mesh/topology.h"

namespace bilayer::detail {
namespace {

constexpr std::size_t leafEdges = 4;

}  // namespace

WindingSlope::WindingSlope(const Mesh& mesh, Progress* progress) {
    Topology(mesh, progress).forEachUnbalancedEdge([&](unsigned first, unsigned second, unsigned count) {
        const glm::vec3 from = mesh.points[first], to = mesh.points[second];
        edges_.push_back({from, to, double(count), 0.5f * (from + to), std::uint32_t(edges_.size())});
    });
    if (edges_.empty()) return;
    const auto split = [&](std::size_t begin, std::size_t middle, std::size_t end) {
        splitAtMedian(std::span(edges_).subspan(begin, end - begin), middle - begin, progress);
    };
    tree_.build(
        edges_.size(), leafEdges, split, [&](std::uint32_t node) { return ballOf(node); }, progress);
}

double WindingSlope::operator()(const glm::dvec3& centre, double radius) const {
    return edges_.empty() ? 0 : bound(0, centre, radius) / (4 * glm::pi<double>());
}

WindingSlope::Ball WindingSlope::ballOf(std::uint32_t node) const {
    const auto edges = std::span(edges_).subspan(tree_[node].begin, tree_[node].end - tree_[node].begin);
    Ball ball{glm::dvec3(edges.front().at), 0, 0};
    for (const UnbalancedEdge& edge : edges) {
        ball.length += edge.excess * glm::length(edge.to - edge.from);
        ball.radius = std::max({ball.radius, glm::length(edge.from - ball.centre), glm::length(edge.to - ball.centre)});
    }
    return ball;
}

double WindingSlope::bound(std::uint32_t node, const glm::dvec3& centre, double radius) const {
    const auto& ball = tree_[node];
    const double separation = glm::length(ball.centre - centre) - ball.radius - radius;
    if (separation > 2 * ball.radius) return ball.length / (separation * separation);
    if (!tree_.isLeaf(node))
        return bound(tree_.first(node), centre, radius) + bound(tree_.second(node), centre, radius);
    double sum = 0;
    for (std::size_t i = ball.begin; i < ball.end; ++i) sum += ofEdge(edges_[i], centre, radius);
    return sum;
}

double WindingSlope::ofEdge(const UnbalancedEdge& edge, const glm::dvec3& centre, double radius) {
    const glm::dvec3 line = edge.to - edge.from;
    const double squared = glm::dot(line, line);
    const double along = squared > 0 ? std::clamp(glm::dot(centre - edge.from, line) / squared, 0.0, 1.0) : 0.0;
    const double separation = glm::length(edge.from + along * line - centre) - radius;
    if (separation <= 0) return std::numeric_limits<double>::infinity();
    // An infinite straight line gives 2 / separation.
    return edge.excess * std::min(std::sqrt(squared) / (separation * separation), 2 / separation);
}

}  // namespace bilayer::detail
