// What readers of scenes share: meshes placed by the transforms of nodes; internal.
#pragma once

#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <vector>

#include "sdf/io/polygons.h"

namespace bilayer::detail {

/// One mesh of a scene in its own coordinates; the members as in Polygons.
struct ScenePart {
    std::vector<glm::dvec3> points;
    std::vector<unsigned> corners;
    std::vector<unsigned> sizes;  ///< empty: each face has three corners
};

/// Appends a part under an affine transform. A transform that mirrors reverses each face, so that outside stays
/// outside. Throws std::runtime_error when there are more points than 32 bits can number.
void place(Polygons& scene, const ScenePart& part, const glm::dmat4& transform);

}  // namespace bilayer::detail
