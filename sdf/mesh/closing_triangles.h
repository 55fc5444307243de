// SPDX-License-Identifier: Apache-2.0
// Triangles that close an open mesh.
// Tested by tests/sdf/closing_triangles.cpp.
#pragma once

#include <glm/vec3.hpp>
#include <vector>

#include <bilayer/sdf/mesh.h>

namespace bilayer::detail {

class Progress;

/// Returns triangles that close a mesh: with them, each edge is used equally often in both directions. Vertices with
/// equal coordinates count as one. The triangles may intersect each other and the mesh. Each loop of n
/// boundary edges gets n - 2 triangles. It is closed by cutting off every second vertex repeatedly, so most of the
/// triangles are small.
/// @param progress  polled, unless null
std::vector<glm::uvec3> closingTriangles(const Mesh& mesh, Progress* progress = nullptr);

}  // namespace bilayer::detail
