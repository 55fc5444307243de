// SPDX-License-Identifier: Apache-2.0
// Common parts of scene readers: meshes placed by node transforms; internal.
// Tested by tests/sdf/scene_io.cpp through readScene().
#pragma once

#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <vector>

#include "sdf/io/polygon/polygons.h"

namespace bilayer::detail {

/// One mesh of a scene in local coordinates. The members are as in Polygons.
struct ScenePart {
    std::vector<glm::dvec3> points;
    std::vector<unsigned> corners;
    std::vector<unsigned> sizes;  ///< empty: each face has three corners
};

/// Appends a part under an affine transform. A mirroring transform reverses each face to preserve the outside. Throws
/// std::runtime_error if the count of points exceeds 32 bits.
void place(Polygons& scene, const ScenePart& part, const glm::dmat4& transform);

}  // namespace bilayer::detail
