// SPDX-License-Identifier: Apache-2.0
// Debug drawing of the parts of a field that btCollisionWorld::debugDrawWorld() does not draw. Bullet itself draws the
// surface of a Shape as triangles (btIDebugDraw::DBG_DrawWireframe), and all contacts (DBG_DrawContactPoints). Call
// these functions after it.
#pragma once

#include <BulletCollision/CollisionDispatch/btCollisionWorld.h>
#include <LinearMath/btIDebugDraw.h>

#include <bilayer/integration/bullet/shape.h>

namespace bilayer::bullet {

/// What is drawn, and in which colours.
struct DrawOptions {
    bool band = true;                      ///< outline of the leaves that hold the band
    bool points = false;                   ///< surface points, drawn as normals of one voxel's length
    btVector3 bandColour{0.3f, 0.6f, 1};   ///< red, green, blue: 0..1
    btVector3 pointColour{1, 0.6f, 0.2f};  ///< of surface points
    btVector3 sharpColour{1, 0.2f, 0.2f};  ///< for points on convex edges and vertices
};

/// Draws a field as lines for a body at this transform.
void drawField(const Shape& shape, const btTransform& transform, btIDebugDraw& drawer, const DrawOptions& options = {});

/// Draws all fields in a world, also inside compounds.
void drawFields(const btCollisionWorld& world, btIDebugDraw& drawer, const DrawOptions& options = {});

}  // namespace bilayer::bullet
