// SPDX-License-Identifier: Apache-2.0
#include "sdf/mesh/surface_sides.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <vector>

namespace bilayer::detail {
namespace {

/// Lines through a place, relative to its normal and two directions across: oblique, so that they pass the edges of
/// solids with right angles. The next one is used if a line hits an edge exactly.
constexpr std::array<std::array<double, 2>, 4> lines{
    {{0.137, 0.071}, {-0.173, 0.119}, {0.089, -0.211}, {-0.061, -0.157}}};

}  // namespace

SurfaceSides::SurfaceSides(const Mesh& mesh, const TriangleTree& tree, bool closed, Progress* progress)
    : mesh_(mesh), tree_(tree), box_(bounds(mesh)), closed_(closed), progress_(progress) {}

const WindingNumber& SurfaceSides::winding() const {
    std::call_once(once_, [this] { winding_.emplace(mesh_, progress_); });
    return *winding_;
}

SideNumbers SurfaceSides::at(const glm::dvec3& place, const glm::dvec3& step) const {
    const glm::dvec3 front = place + step, behind = place - step;
    if (!closed_) return {winding().isInside(front), winding().isInside(behind)};
    const glm::dvec3 normal = glm::normalize(step);
    const glm::dvec3 helper = std::abs(normal.x) < 0.5 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0);
    const glm::dvec3 u = glm::normalize(glm::cross(normal, helper)), v = glm::cross(normal, u);
    for (const auto& [alongU, alongV] : lines)
        if (const auto numbers = alongLine(place, step, glm::normalize(normal + alongU * u + alongV * v)))
            return *numbers;
    return {winding().nearestInteger(front), winding().nearestInteger(behind)};
}

// The winding number of a point on a line is the sum of the crossings beyond it. The line passes the two points at the
// same heights above the triangle.
std::optional<SideNumbers> SurfaceSides::alongLine(const glm::dvec3& place, const glm::dvec3& step,
                                                   const glm::dvec3& oblique) const {
    const glm::dvec3 direction = exitAlong(place, oblique) <= exitAlong(place, -oblique) ? oblique : -oblique;
    const double front = glm::dot(step, step) / glm::dot(step, direction);
    thread_local std::vector<Crossing> found;
    if (!tree_.crossings(place, direction, found, -std::abs(front))) return std::nullopt;
    SideNumbers numbers{0, 0};
    for (const Crossing& crossing : found) {
        if (crossing.along > front) numbers.front += crossing.sign;
        if (crossing.along > -front) numbers.behind += crossing.sign;
    }
    return numbers;
}

// Returns how far it is to leave the mesh's bounding box.
double SurfaceSides::exitAlong(const glm::dvec3& place, const glm::dvec3& direction) const {
    double exit = std::numeric_limits<double>::infinity();
    for (int axis = 0; axis < 3; ++axis) {
        const double side = double(direction[axis] > 0 ? box_.upper[axis] : box_.lower[axis]);
        if (direction[axis] != 0) exit = std::min(exit, (side - place[axis]) / direction[axis]);
    }
    return exit;
}

}  // namespace bilayer::detail
