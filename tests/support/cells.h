// Solids with right angles: the union of some cells of a grid of planes, and the surface of it, which is closed,
// oriented and exact.
#pragma once

#include <array>
#include <functional>
#include <glm/vec3.hpp>
#include <vector>

#include <bilayer/sdf/mesh.h>

namespace bilayer::test {

/// The planes along each axis, in ascending order.
using Planes = std::array<std::vector<float>, 3>;

/// The surface of the filled cells. Cell (x, y, z) lies between the planes x and x + 1 and so on.
Mesh solidOf(const Planes& planes, const std::function<bool(const glm::ivec3& cell)>& filled);

}  // namespace bilayer::test
