// SPDX-License-Identifier: Apache-2.0
#include "collider/contact/body/outer_side.h"

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/constants.hpp>
#include <optional>

#include "collider/field/triangles/mesh_rays.h"

namespace bilayer::detail {

namespace {

constexpr double rayStart = 0.02;          // of rays over the surface [spacings]
constexpr int raysOfRing = 6;              // in directions of equal angle to the normal
constexpr double ringAngles[] = {0.5, 1};  // to the normal [radians]
constexpr double minRatio = 1.02;          // of the views of both sides that differ

}  // namespace

OuterSide::OuterSide(const Mesh& mesh, double spacing)
    : mesh_(mesh, float(spacing)), size_(bounds(mesh).longestSide()), start_(rayStart * spacing) {}

bool OuterSide::isInner(const glm::dvec3& position, const glm::dvec3& normal) const {
    return meanView(position, -normal) > minRatio * meanView(position, normal);
}

/// The mean length of rays until they meet the mesh, at most its size.
double OuterSide::meanView(const glm::dvec3& position, const glm::dvec3& normal) const {
    const auto view = [&](const glm::dvec3& direction) {
        const std::optional<MeshHit> hit = firstHit(mesh_, {position + start_ * normal, direction, size_});
        return hit ? hit->along : size_;
    };
    const glm::dvec3 side = std::abs(normal.x) < 0.7 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0);
    const glm::dvec3 across = glm::normalize(glm::cross(normal, side)), along = glm::cross(normal, across);
    double sum = view(normal);
    int count = 1;
    for (const double angle : ringAngles)
        for (int i = 0; i < raysOfRing; ++i, ++count) {
            const double turn = glm::two_pi<double>() * i / raysOfRing;
            sum +=
                view(std::cos(angle) * normal + std::sin(angle) * (std::cos(turn) * across + std::sin(turn) * along));
        }
    return sum / count;
}

}  // namespace bilayer::detail
