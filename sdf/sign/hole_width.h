// SPDX-License-Identifier: Apache-2.0
// The width of the holes of a mesh.
#pragma once

#include <glm/vec3.hpp>

#include <bilayer/sdf/mesh.h>

namespace bilayer::detail {

class Progress;

/// The widest hole of a mesh. A hole is closed by the surface on which the winding number is one half. Its width is the
/// diameter of the largest ball around a point of that surface that contains no triangle.
struct Hole {
    double width = 0;      ///< [m], up to 10 % too large; 0: no hole
    glm::dvec3 centre{0};  ///< centre of the ball [m]
};

/// Finds the widest hole with at least a minimum width. The minimum decides whether it is found, not its width. Parts
/// that protrude from a solid and have no interior also count as a hole where winding numbers of one half surround
/// them. The mesh must be valid and face outward (see orient()).
/// @param minimum   minimum width [m], positive
/// @param progress  polled for cancellation, unless null
Hole widestHole(const Mesh& mesh, double minimum, Progress* progress = nullptr);

}  // namespace bilayer::detail
