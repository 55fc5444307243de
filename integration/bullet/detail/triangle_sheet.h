// SPDX-License-Identifier: Apache-2.0
// Bullet's meshes and height fields as sheets of triangles.
// Tested by tests/bullet/open_surface.cpp.
#pragma once

#include <BulletCollision/CollisionShapes/btConcaveShape.h>

#include <bilayer/collider/shapes.h>

namespace bilayer::bullet::detail {

/// @param shape  must outlive the sheet
TriangleSheet sheetOf(const btConcaveShape& shape);

}  // namespace bilayer::bullet::detail
