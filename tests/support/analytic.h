// SPDX-License-Identifier: Apache-2.0
// Solids by formula: distances in double precision, and level sets of them made without the double layer method.
#pragma once

#include <functional>
#include <glm/vec3.hpp>

#include <bilayer/sdf/level_set.h>
#include <bilayer/sdf/mesh.h>

namespace bilayer::test {

/// A solid: its signed distance [m], and the half size of a box around it, about `centre`.
struct Solid {
    std::function<double(const glm::dvec3&)> distance;
    glm::dvec3 halfSize;
    glm::dvec3 centre{0};
};

Solid sphereSolid(double radius, const glm::dvec3& centre = glm::dvec3(0));
Solid boxSolid(const glm::dvec3& half);
Solid torusSolid(double major, double minor);

/// The level set of a solid; widths in voxels.
LevelSet levelSetOf(const Solid& solid, double voxel, float exterior = 3, float interior = 3);

/// The field of a mesh by the double layer method.
LevelSet built(const Mesh& mesh, float voxel);

}  // namespace bilayer::test
