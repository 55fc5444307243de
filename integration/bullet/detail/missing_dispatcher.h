// SPDX-License-Identifier: Apache-2.0
// The warning about fields in a process without a dispatcher for them; internal.
//
// For two concave shapes, Bullet's own tables hold an algorithm that does nothing, so neither shape is called when such
// a pair meets. A world calls a shape for its bounding box: once a step for each body, and right after that for a
// dynamic body's predicted pose. It passes triangles to a convex body by a callback of its own.
// Tested by tests/bullet/stock.cpp through bullet::Shape.
#pragma once

#include <BulletCollision/CollisionShapes/btTriangleCallback.h>
#include <LinearMath/btTransform.h>

namespace bilayer::bullet::detail {

/// Held by each Dispatcher and FieldAlgorithms. While one exists, there is no warning.
class FieldDispatcherMark {
  public:
    FieldDispatcherMark();
    ~FieldDispatcherMark();
    FieldDispatcherMark(const FieldDispatcherMark&) = delete;
    FieldDispatcherMark& operator=(const FieldDispatcherMark&) = delete;
};

/// Warns if a world moves a dynamic body with a field. To be called for each box of a field, from any thread.
/// @param transform  its address identifies the body
void noteBox(const void* field, const btTransform& transform);

/// Warns if Bullet collides a field's triangles with a convex body. To be called for each callback.
void noteTriangles(const btTriangleCallback& callback);

}  // namespace bilayer::bullet::detail
