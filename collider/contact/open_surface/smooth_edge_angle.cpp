// SPDX-License-Identifier: Apache-2.0
#include "collider/contact/open_surface/smooth_edge_angle.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>

namespace bilayer::detail {
namespace {

/// Smaller angles are rounding of normals [rad].
constexpr double minAngle = 1e-3;
/// Predicted contacts stay this close to their surface [voxels].
constexpr float nearby = 2;

}  // namespace

float maxSmoothEdgeAngle(std::span<const Triangle> triangles) {
    const Adjacency adjacency(triangles);
    float maxSine = 0;
    for (std::uint32_t t = 0; t < triangles.size(); ++t)
        for (int i = 0; i < 3; ++i) {
            const auto conormals = adjacency.conormalsOf(t, i);
            if (!conormals || !(-glm::dot((*conormals)[0], (*conormals)[1]) > smoothEdgeCosine)) continue;
            maxSine = std::max(maxSine, glm::length(glm::cross((*conormals)[0], (*conormals)[1])));
        }
    return std::asin(std::min(maxSine, 1.f));
}

// The normal of an edge is the mean of two unit normals: half the angle away from each.
float smoothEdgeAngleAt(const MeshTree& tree, const glm::vec3& point) {
    const std::uint32_t piece = tree.nearestPiece(glm::dvec3(point), nearby);
    if (piece == MeshTree::noPiece) return 0;
    const std::uint32_t triangle = tree.featureOfPiece(piece, glm::dvec3(point)).triangle;
    const Mesh& mesh = tree.mesh();
    const glm::uvec3 corners = mesh.triangles[triangle];
    const glm::dvec3 p[] = {mesh.points[corners.x], mesh.points[corners.y], mesh.points[corners.z]};
    const glm::dvec3 face = glm::normalize(glm::cross(p[1] - p[0], p[2] - p[0]));
    double maxAngle = 0;
    for (int i = 0; i < 3; ++i) {
        const glm::dvec3 edge = tree.featureOf(triangle, 0.5 * (p[i] + p[(i + 1) % 3])).normal;
        const double angle = 2 * std::atan2(glm::length(glm::cross(face, edge)), glm::dot(face, edge));
        if (angle > minAngle && std::cos(angle) > double(smoothEdgeCosine)) maxAngle = std::max(maxAngle, angle);
    }
    return float(maxAngle);
}

}  // namespace bilayer::detail
