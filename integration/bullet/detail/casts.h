// SPDX-License-Identifier: Apache-2.0
// Casts: spheres swept through a field or a mesh until the first contact.
#pragma once

#include <optional>

#include <bilayer/collider/collider.h>
#include <bilayer/collider/contact.h>
#include "collider/field/triangles/mesh_tree.h"

namespace bilayer::bullet::detail {

using namespace bilayer::detail;

struct CastHit {
    float fraction;      ///< of the path, 0..1
    glm::vec3 position;  ///< point of contact, in the world [m]
    glm::vec3 normal;    ///< outward normal of the field, in the world, of unit length
    int triangle = -1;   ///< index in the mesh, if there is one
};

/// Whether the band is wide enough to sweep a sphere of this radius [m].
bool bandFitsSphere(const Placed& body, float radius);

/// Sweeps a sphere along the path of its centre, and returns the first position where it penetrates the field by
/// `allowed` [m]. A sphere that starts deeper hits at once if it moves inward, as in Bullet. Uses conservative
/// advancement on the field.
std::optional<CastHit> castSphereOn(const Placed& body, const glm::vec3& from, const glm::vec3& to, float radius,
                                    float allowed);

/// Sweeps a sphere along the path of its centre, and returns the first position where it touches a mesh, to 1e-6
/// voxels. All values are in the mesh's coordinates.
/// @param radius  [m], positive; the sphere touches nothing at the start
std::optional<CastHit> castSphereOn(const MeshTree& mesh, const glm::vec3& from, const glm::vec3& to, float radius);

/// Whether the distance from a sphere's centre to a mesh is below its radius [m].
bool touches(const MeshTree& mesh, const glm::vec3& centre, float radius);

}  // namespace bilayer::bullet::detail
