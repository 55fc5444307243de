// SPDX-License-Identifier: Apache-2.0
// The winding number of a mesh around a point, by the crossings of one ray. May run on any number of threads at once,
// and allocates nothing.
// Tested by tests/collider/sides.cpp through closest().
#pragma once

#include <optional>

#include "collider/field/triangles/mesh_tree.h"

namespace bilayer::detail {

/// The winding number around a point of a mesh whose half-edges balance (balanced()); meaningless for others. Exact:
/// rounding plays no part, and a ray through an edge or vertex counts each crossing once. Points on the surface belong
/// to either side. Nothing if the ray crosses more than 256 triangles, or for a point that is not finite.
std::optional<int> windingNumber(const MeshTree& mesh, const glm::vec3& point) noexcept;

}  // namespace bilayer::detail
