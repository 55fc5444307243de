// SPDX-License-Identifier: Apache-2.0
// The distance of a triangle mesh from convex solids and planes.
// Tested by tests/collider/shape_distance.cpp through distance().
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <limits>

#include "collider/contact/distance/mesh_distance.h"
#include "collider/contact/distance/triangle_distance.h"
#include "collider/contact/shapes/convex.h"
#include "collider/contact/shapes/shape_data.h"
#include "collider/field/triangles/mesh_tree.h"

namespace bilayer::detail {

/// The point of a mesh that is nearest to a solid, and the point of the solid nearest to it.
struct SolidDistance {
    std::uint32_t triangle = noTriangle;  ///< `noTriangle`: nothing within the limit
    TrianglePoint onMesh;
    glm::dvec3 onSolid{0};
    double distance = std::numeric_limits<double>::infinity();

    bool found() const { return triangle != noTriangle; }
};

/// The distance of a mesh from a convex body; 0 if the surface of the mesh meets it, or lies in it. All lengths are
/// those of the mesh's coordinates. Exact to 1e-6 of the sizes of both bodies.
/// @param toMesh  maps coordinates of the solid to those of the mesh
/// @param limit   finds nothing beyond this distance
/// @param start   a triangle that may be near, or `noTriangle`
SolidDistance nearestTo(const Convex& convex, const MeshTree& mesh, const Similarity& toMesh, double limit,
                        std::uint32_t start);
/// The same for a plane: the height of the lowest vertex over it, which may be negative.
SolidDistance nearestTo(const HalfSpace& solid, const MeshTree& mesh, const Similarity& toMesh, double limit,
                        std::uint32_t start);
/// The same for a triangle; 0 if the surface of the mesh meets it.
SolidDistance nearestTo(const Triangle& triangle, const MeshTree& mesh, const Similarity& toMesh, double limit,
                        std::uint32_t start);

}  // namespace bilayer::detail
