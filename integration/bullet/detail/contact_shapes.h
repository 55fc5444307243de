// SPDX-License-Identifier: Apache-2.0
// Bullet's shapes as contact shapes.
// Tested by tests/bullet/convex.cpp and tests/bullet/open_surface.cpp.
#pragma once

#include <BulletCollision/CollisionShapes/btConcaveShape.h>
#include <BulletCollision/CollisionShapes/btConvexShape.h>

#include <array>

#include <bilayer/collider/shapes.h>
#include "collider/contact/shapes/convex.h"

namespace bilayer::bullet::detail {

using namespace bilayer::detail;

/// The convex body of a shape. Coordinates are those of the btConvexShape, with its scaling and margin, in metres.
/// Spheres, capsules, boxes, cylinders, cones and multispheres are exact for any margin. Hulls and unknown shapes are
/// hulls of their (support) points, grown by Bullet's margin as everywhere in Bullet.
Convex convexOf(const btConvexShape& shape);

/// The triangles of a mesh or a height field.
/// @param shape  must outlive the open surface
OpenSurface openSurfaceOf(const btConcaveShape& shape);

/// A shape other than a compound, without its pose. A field's pose and scale are those of Shape::placed().
/// @param shape  must outlive the contact shape, if it has triangles
ContactShape contactShapeOf(const btCollisionShape& shape);

/// The contact shape of a convex shape that may change.
class ConvexShape {
  public:
    explicit ConvexShape(const btConvexShape& shape);

    const ContactShape& contactShape() const { return contactShape_; }
    /// Whether this object represents the shape. False for another shape, and after the shape has changed its scaling,
    /// size, margin or number of points.
    bool represents(const btConvexShape& shape) const;

  private:
    const btConvexShape* shape_;  ///< only compared, not dereferenced
    btVector3 scaling_;
    float margin_;
    int vertexCount_;
    std::array<btVector3, 2> bounds_;
    ContactShape contactShape_;
};

}  // namespace bilayer::bullet::detail
