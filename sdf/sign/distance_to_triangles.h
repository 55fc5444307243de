// SPDX-License-Identifier: Apache-2.0
// The distance of a point to the triangles of a mesh, in double precision.
// Tested by tests/sdf/hole_width.cpp through widestHole().
#pragma once

#include <algorithm>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include <bilayer/sdf/mesh.h>
#include "sdf/bvh/triangle_tree.h"
#include "sdf/sign/closest_side.h"

namespace bilayer::detail {

/// Returns the distance to the nearest triangle, or `bound` if that is less [m].
/// @param tree  of the mesh
inline double distanceToTriangles(const Mesh& mesh, const TriangleTree& tree, const glm::dvec3& point, double bound) {
    tree.descend(
        [&](const Bounds& box) {
            const glm::dvec3 across =
                glm::max(glm::max(glm::dvec3(box.lower) - point, point - glm::dvec3(box.upper)), glm::dvec3(0));
            return glm::length(across) <= bound;
        },
        [&](unsigned triangle) {
            const glm::uvec3& t = mesh.triangles[triangle];
            const TriangleCorners corners{glm::dvec3(mesh.points[t.x]), glm::dvec3(mesh.points[t.y]),
                                          glm::dvec3(mesh.points[t.z])};
            bound = std::min(bound, distanceTo(corners, point));
        });
    return bound;
}

}  // namespace bilayer::detail
