// How wide the holes of a mesh are.
#pragma once

#include <glm/vec3.hpp>

#include <bilayer/sdf/mesh.h>

namespace bilayer::detail {

class Progress;

/// The widest hole of a mesh. A hole is closed by the surface on which the winding number is a half; its width is the
/// diameter of the largest ball around a point of that surface that no triangle reaches into.
struct Hole {
    double width = 0;      ///< [m], to 10 %; 0: there is none
    glm::dvec3 centre{0};  ///< of that ball [m]
};

/// Finds the widest hole, if any is at least so wide. What sticks out of a solid without an inside of its own counts as
/// a hole as well where winding numbers of a half surround it. The mesh must be valid, and face outward: see orient().
/// @param least     [m], positive
/// @param progress  polled, unless null
Hole widestHole(const Mesh& mesh, double least, Progress* progress = nullptr);

}  // namespace bilayer::detail
