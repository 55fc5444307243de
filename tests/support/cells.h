// SPDX-License-Identifier: Apache-2.0
// Solids with right angles: unions of cells of an axis-aligned grid. Their surface is closed, oriented and exact.
#pragma once

#include <array>
#include <functional>
#include <glm/vec3.hpp>
#include <vector>

#include <bilayer/sdf/mesh.h>

namespace bilayer::test {

/// The planes along each axis, in ascending order.
using Planes = std::array<std::vector<float>, 3>;

/// The surface of the filled cells. Cell (x, y, z) lies between planes x and x + 1, and likewise along y and z.
Mesh solidOf(const Planes& planes, const std::function<bool(const glm::ivec3& cell)>& filled);

}  // namespace bilayer::test
