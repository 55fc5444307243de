// SPDX-License-Identifier: Apache-2.0
// The angles between the faces of a surface of triangles at its smooth edges.
// Tested by tests/bullet/smooth_ground.cpp.
#pragma once

#include <glm/vec3.hpp>
#include <span>

#include "collider/contact/open_surface/open_surface.h"
#include "collider/field/triangles/mesh_tree.h"

namespace bilayer::detail {

/// An edge is smooth if the normals of its faces differ by less than 20 degrees (cosine).
constexpr float smoothEdgeCosine = 0.94f;

/// The maximum angle between the normals of two faces at the smooth edges of triangles; 0 if there are none [rad].
float maxSmoothEdgeAngle(std::span<const Triangle> triangles);

/// The same of the edges of the triangle that is nearest to a point of its mesh [m]. 0 if none is within two voxels.
float smoothEdgeAngleAt(const MeshTree& mesh, const glm::vec3& point);

}  // namespace bilayer::detail
