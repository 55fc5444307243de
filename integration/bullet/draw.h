// What btCollisionWorld::debugDrawWorld() does not know of fields. Bullet itself draws the surface of a Shape, as
// triangles (btIDebugDraw::DBG_DrawWireframe), and all contacts (DBG_DrawContactPoints); call these after it.
#pragma once

#include <BulletCollision/CollisionDispatch/btCollisionWorld.h>
#include <LinearMath/btIDebugDraw.h>

#include <bilayer/integration/bullet/shape.h>

namespace bilayer::bullet {

struct DrawOptions {
    bool band = true;                      ///< the outline of the blocks that the band lies in
    bool points = false;                   ///< surface points, as normals of the spacing's length
    btVector3 bandColour{0.3f, 0.6f, 1};   ///< red, green, blue: 0..1
    btVector3 pointColour{1, 0.6f, 0.2f};  ///< likewise
    btVector3 sharpColour{1, 0.2f, 0.2f};  ///< likewise, of points on convex edges and corners
};

/// Draws a field as lines, where a body of this transform has it.
void drawField(const Shape& shape, const btTransform& transform, btIDebugDraw& drawer, const DrawOptions& options = {});

/// The same for all fields in a world, also inside compounds.
void drawFields(const btCollisionWorld& world, btIDebugDraw& drawer, const DrawOptions& options = {});

}  // namespace bilayer::bullet
