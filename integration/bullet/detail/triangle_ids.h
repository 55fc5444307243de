// Which triangle of a mesh or a height field a contact is with: what Bullet's users take materials by; internal.
#pragma once

#include <BulletCollision/CollisionShapes/btConcaveShape.h>
#include <LinearMath/btTransform.h>

#include <optional>
#include <span>
#include <vector>

namespace bilayer::bullet::detail {

/// A triangle by the numbers that Bullet hands to btTriangleCallback::processTriangle(); both triangles of a height
/// field's cell have the same ones.
struct TriangleId {
    int part, index;
};

/// A place on a mesh, in the world.
struct MeshPlace {
    btVector3 position;  ///< [m]
    btVector3 normal;    ///< of the contact, of either sign
};

/// The nearest triangle to each place. Of several that are as near, as around an edge or a corner, it is the one whose
/// normal is the nearest to the contact's.
/// @param reach      how far triangles may be from their places; nothing is named beyond [m]
/// @param tolerance  triangles whose distances differ by less are as near [m]
std::vector<std::optional<TriangleId>> trianglesAt(const btConcaveShape& mesh, const btTransform& transform,
                                                   std::span<const MeshPlace> places, float reach, float tolerance);

}  // namespace bilayer::bullet::detail
