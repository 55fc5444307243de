// SPDX-License-Identifier: Apache-2.0
#include "sdf/sign/winding_slope.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/constants.hpp>
#include <limits>

#include "sdf/bvh/median_tree.h"
#include "sdf/mesh/topology.h"

namespace bilayer::detail {

WindingSlope::WindingSlope(const Mesh& mesh, Progress* progress) {
    Topology(mesh, progress).forEachUnbalancedEdge([&](unsigned first, unsigned second, unsigned count) {
        const glm::vec3 from = mesh.points[first], to = mesh.points[second];
        edges_.push_back({from, to, double(count), 0.5f * (from + to), std::uint32_t(edges_.size())});
    });
    if (edges_.empty()) return;
    nodes_.resize(medianTreeNodes(edges_.size(), leafEdges));
    build(0, 0, edges_.size(), progress);
}

double WindingSlope::operator()(const glm::dvec3& centre, double radius) const {
    return nodes_.empty() ? 0 : bound(0, centre, radius) / (4 * glm::pi<double>());
}

void WindingSlope::build(std::size_t at, std::size_t begin, std::size_t end, Progress* progress) {
    Node& node = nodes_[at];
    node = {glm::dvec3(edges_[begin].at), 0, 0, begin, end, 0};
    for (std::size_t i = begin; i < end; ++i) {
        const UnbalancedEdge& edge = edges_[i];
        node.length += edge.excess * glm::length(edge.to - edge.from);
        node.radius = std::max({node.radius, glm::length(edge.from - node.centre), glm::length(edge.to - node.centre)});
    }
    if (end - begin <= leafEdges) return;
    const std::size_t middle = splitAtMedian(edges_, begin, end, progress);
    node.right = at + 1 + medianTreeNodes(middle - begin, leafEdges);
    buildChildren(
        end - begin, [&] { build(at + 1, begin, middle, progress); },
        [&] { build(node.right, middle, end, progress); });
}

double WindingSlope::bound(std::size_t at, const glm::dvec3& centre, double radius) const {
    const Node& node = nodes_[at];
    const double separation = glm::length(node.centre - centre) - node.radius - radius;
    if (separation > 2 * node.radius) return node.length / (separation * separation);
    double sum = 0;
    if (node.right != 0) return bound(at + 1, centre, radius) + bound(node.right, centre, radius);
    for (std::size_t i = node.begin; i < node.end; ++i) sum += ofEdge(edges_[i], centre, radius);
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
