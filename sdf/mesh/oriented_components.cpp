// SPDX-License-Identifier: Apache-2.0
#include "sdf/mesh/oriented_components.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/constants.hpp>
#include <vector>

namespace bilayer::detail {
namespace {

/// Min ratio of a component's volume to that of a sphere with the same area, above which it separates inside from
/// outside. Closed components only need to exceed rounding errors. Open components need a margin for error; below it
/// they count as open surfaces.
constexpr double minRoundnessClosed = 1e-9;
constexpr double minRoundnessOpen = 1e-2;
/// Max area of the holes of a doubled surface that still is the surface of a solid, relative to its area. The open side
/// of a box or a bowl takes more.
constexpr double maxHolePart = 0.05;

double roundness(const OrientedComponent& c) {
    return 6 * std::sqrt(glm::pi<double>()) * std::abs(c.volume) / std::pow(c.area, 1.5);
}

// Of all holes with the same border, a circle has the largest area. Each face of the component exists twice, and so
// does each use of an edge.
bool isClosedButForSmallHoles(const OrientedComponent& c) {
    const double border = 0.5 * c.borderLength, area = 0.5 * c.area;
    return c.closed() || border * border / (4 * glm::pi<double>()) <= maxHolePart * area;
}

}  // namespace

glm::dvec3 OrientedComponent::apex() const {
    return borderLength > 0 && !closed() ? borderCentre / borderLength : glm::dvec3(bounds.centre());
}

bool OrientedComponent::bounding() const {
    return !oneSided && !twoSided && area > 0 && roundness(*this) > (closed() ? minRoundnessClosed : minRoundnessOpen);
}

OrientedComponents::OrientedComponents(const Mesh& mesh, ConsistentTriangles& consistent)
    : mesh_(mesh), consistent_(consistent) {
    gather();
    keepMajority();
    measure();
}

glm::dvec3 OrientedComponents::areaVector(unsigned i) const {
    return 0.5 * glm::cross(point(i, 1) - point(i, 0), point(i, 2) - point(i, 0));
}

void OrientedComponents::gather() {
    const std::vector<std::uint64_t> sums = consistent_.edgeSums();
    componentOf_.assign(mesh_.triangles.size(), 0);
    flipped_.assign(mesh_.triangles.size(), false);
    for (const unsigned i : consistent_.eachTriangle()) {
        const unsigned root = consistent_.root(i);
        // a root is the smallest number of its set, so it comes first
        if (root == i) {
            componentOf_[i] = unsigned(components_.size());
            components_.emplace_back().edgeSum = sums[i];
        }
        componentOf_[i] = componentOf_[root];
        flipped_[i] = consistent_.oppositeToRoot(i);
        componentOf(i).triangles.push_back(i);
    }
    for (const unsigned triangle : consistent_.contradictions()) componentOf(triangle).oneSided = true;
    for (const unsigned i : consistent_.eachTriangle()) componentOf(i).area += glm::length(areaVector(i));
    findBorders();
    findTwoSided();
}

// A doubled body is a solid only if all of its components are closed but for small holes.
void OrientedComponents::findTwoSided() {
    std::vector<bool> open(mesh_.triangles.size());
    for (const unsigned i : consistent_.eachTriangle())
        if (componentOf(i).oneSided || !isClosedButForSmallHoles(componentOf(i))) open[consistent_.body(i)] = true;
    for (const unsigned i : consistent_.eachTriangle())
        componentOf(i).twoSided = consistent_.doubled(i) && open[consistent_.body(i)];
}

void OrientedComponents::keepMajority() {
    for (const unsigned i : consistent_.eachTriangle()) {
        OrientedComponent& component = componentOf(i);
        if (flipped_[i]) component.flippedArea += glm::length(areaVector(i));
        component.mixed |= flipped_[i] && consistent_.topology().proper(i);
        for (int k = 0; k < 3; ++k) component.bounds.add(mesh_.points[mesh_.triangles[i][k]]);
    }
    for (OrientedComponent& component : components_) {
        if (component.oneSided || component.twoSided) {
            for (const unsigned i : component.triangles) flipped_[i] = false;
            component.mixed = false;
        } else if (component.flippedArea > 0.5 * component.area)
            flip(component);
    }
}

void OrientedComponents::flip(OrientedComponent& component) {
    for (const unsigned i : component.triangles) flipped_[i] = !flipped_[i];
    component.volume = -component.volume;
}

void OrientedComponents::measure() {
    for (const unsigned i : consistent_.eachTriangle()) {
        if (!consistent_.counts(i)) continue;
        OrientedComponent& component = componentOf(i);
        const double volume = glm::dot(areaVector(i), point(i, 0) - component.apex()) / 3;
        component.volume += flipped_[i] ? -volume : volume;
    }
}

// Finds the unbalanced edges of each component, and sums them weighted by length and by their uses.
void OrientedComponents::findBorders() {
    struct Use {
        unsigned component;
        int net;  // the direction as oriented; 0 if the triangle does not count
    };
    std::vector<Use> sorted;
    consistent_.topology().forEachEdge([&](std::span<const EdgeUse> uses) {
        sorted.clear();
        for (const EdgeUse& use : uses) {
            const int direction = flipped_[use.triangle] ? -use.direction() : use.direction();
            sorted.push_back({componentOf_[use.triangle], consistent_.counts(use.triangle) ? direction : 0});
        }
        std::sort(sorted.begin(), sorted.end(), [](const Use& a, const Use& b) { return a.component < b.component; });
        const glm::dvec3 a = mesh_.points[uses[0].low], b = mesh_.points[uses[0].high];
        for (std::size_t begin = 0, end = 0; begin < sorted.size(); begin = end) {
            int net = 0;
            for (; end < sorted.size() && sorted[end].component == sorted[begin].component; ++end)
                net += sorted[end].net;
            if (net == 0) continue;
            OrientedComponent& component = components_[sorted[begin].component];
            const double length = double(end - begin) * glm::length(b - a);
            component.borderCentre += 0.5 * length * (a + b);
            component.borderLength += length;
        }
    });
}

void OrientedComponents::flip(std::size_t component) {
    flip(components_[component]);
    components_[component].flipped = true;
}

}  // namespace bilayer::detail
