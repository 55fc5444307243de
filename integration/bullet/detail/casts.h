// Rays and spheres moved through a field or a mesh until they touch.
#pragma once

#include <optional>

#include <bilayer/collider/collider.h>
#include <bilayer/collider/contact.h>
#include "collider/field/mesh_tree.h"

namespace bilayer::bullet::detail {

using namespace bilayer::detail;

struct SweepHit {
    float fraction;      ///< of the way, 0..1
    glm::vec3 position;  ///< where the surfaces touch, in the world [m]
    glm::vec3 normal;    ///< of the field, outward, in the world, of unit length
    int triangle = -1;   ///< of the mesh, where there is one
};

/// True if the band is wide enough to tell when a sphere of this radius [m] touches.
bool sweepable(const Placed& body, float radius);

/// The first place on the way of a sphere's centre where the sphere enters the field by `allowed` [m]; a sphere that
/// starts deeper hits at once if it moves inward, as in Bullet. By conservative advancement on the field.
std::optional<SweepHit> sweepSphere(const Placed& body, const glm::vec3& from, const glm::vec3& to, float radius,
                                    float allowed);

/// The first place on the way of a sphere's centre where the sphere touches a mesh, to 1e-6 voxels. All in the mesh's
/// coordinates.
/// @param radius  [m], positive; the sphere touches nothing at the start
std::optional<SweepHit> sweepSphere(const MeshTree& mesh, const glm::vec3& from, const glm::vec3& to, float radius);

/// Whether a sphere is nearer to a mesh than its radius [m].
bool touches(const MeshTree& mesh, const glm::vec3& centre, float radius);

}  // namespace bilayer::bullet::detail
