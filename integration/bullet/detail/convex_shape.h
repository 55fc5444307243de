// SPDX-License-Identifier: Apache-2.0
// Bullet's convex shapes as convex bodies in closed form.
// Tested by tests/bullet/convex.cpp.
#pragma once

#include <BulletCollision/CollisionShapes/btConvexShape.h>

#include <array>

#include "collider/contact/convex.h"

namespace bilayer::bullet::detail {

using namespace bilayer::detail;

/// The convex body of a shape. Coordinates are those of the btConvexShape, with its scaling and margin, in metres.
/// Spheres, capsules, boxes, cylinders, cones and multispheres are exact for any margin. Hulls and unknown shapes are
/// hulls of their (support) points, grown by Bullet's margin as everywhere in Bullet.
Convex convexOf(const btConvexShape& shape);

/// The convex body of a shape that may change.
class ConvexShape {
  public:
    explicit ConvexShape(const btConvexShape& shape);

    const Convex& convex() const { return convex_; }
    /// Whether this object represents the shape. False for another shape, and after the shape has changed its scaling,
    /// size, margin or number of points.
    bool represents(const btConvexShape& shape) const;

  private:
    const btConvexShape* shape_;  ///< only compared, not dereferenced
    btVector3 scaling_;
    float margin_;
    int vertexCount_;
    std::array<btVector3, 2> bounds_;
    Convex convex_;
};

}  // namespace bilayer::bullet::detail
