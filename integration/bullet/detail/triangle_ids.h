// SPDX-License-Identifier: Apache-2.0
// Finds the triangle of a mesh or a height field that a contact touches, for example to look up a material; internal.
// Tested by tests/bullet/triangle_ids.cpp through bullet::Dispatcher.
#pragma once

#include <BulletCollision/CollisionShapes/btConcaveShape.h>
#include <LinearMath/btTransform.h>

#include <optional>
#include <span>
#include <vector>

namespace bilayer::bullet::detail {

/// A triangle by the numbers that Bullet passes to btTriangleCallback::processTriangle(). Both triangles of a height
/// field's cell have the same ones.
struct TriangleId {
    int part, index;
};

/// A triangle next to a point.
struct NearTriangle {
    TriangleId id;
    float cosine;  ///< between the normals of the triangle and of the contact, of either sign
};

/// A point on a mesh, in the world.
struct MeshPlace {
    btVector3 position;  ///< [m]
    btVector3 normal;    ///< normal of the contact, of either sign
};

/// The nearest triangle to each point. Of several equally near ones, as around an edge or vertex, it is the one whose
/// normal is nearest to the contact's.
/// @param reach      maximum distance of a triangle from its point; none is returned beyond [m]
/// @param tolerance  distances that differ by less are equal [m]
std::vector<std::optional<NearTriangle>> trianglesAt(const btConcaveShape& mesh, const btTransform& transform,
                                                     std::span<const MeshPlace> places, float reach, float tolerance);

}  // namespace bilayer::bullet::detail
