// SPDX-License-Identifier: Apache-2.0
#include <bilayer/collider/contact.h>
#include <bilayer/integration/bullet/draw.h>

#include "collider/contact/body/collider_data.h"
#include "collider/field/samples/field_data.h"

#include <BulletCollision/CollisionDispatch/btCollisionObject.h>
#include <BulletCollision/CollisionShapes/btCompoundShape.h>

#include <glm/vec3.hpp>

#include "integration/bullet/detail/convert.h"
#include "sdf/base/access.h"

namespace bilayer::bullet {

using namespace detail;
using namespace bilayer::detail;

namespace {

constexpr float normalVoxels = 1;  // length of a surface point's line [voxels]

// Whether an edge of the leaf lattice is on the outline of the occupied leaves. It is if one, three, or two opposite
// ones of the four leaves around it are occupied. Two adjacent ones make a flat face.
bool isOutline(bool here, bool neighbourU, bool neighbourV, bool diagonal) {
    const int occupied = here + neighbourU + neighbourV + diagonal;
    return occupied == 1 || occupied == 3 || (occupied == 2 && here == diagonal);
}

// Calls line(from, to) for the edges along one axis [leaves]; collinear edges in a row make one line.
template <class Line>
void visitOutline(const Field& field, int axis, Line&& line) {
    const glm::ivec3 size = dataOf(field).blocks;
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    glm::ivec3 at(0), unitU(0), unitV(0);
    unitU[u] = unitV[v] = 1;
    for (at[u] = 0; at[u] <= size[u]; ++at[u])
        for (at[v] = 0; at[v] <= size[v]; ++at[v]) {
            glm::ivec3 start(-1);
            for (at[axis] = 0; at[axis] <= size[axis]; ++at[axis]) {
                const bool outlined =
                    isOutline(dataOf(field).keeps(at), dataOf(field).keeps(at - unitU), dataOf(field).keeps(at - unitV),
                              dataOf(field).keeps(at - unitU - unitV));
                if (outlined && start[axis] < 0) start = at;
                if (outlined || start[axis] < 0) continue;
                line(start, at);
                start = glm::ivec3(-1);
            }
        }
}

void drawBand(const Shape& shape, const Placed& here, btIDebugDraw& drawer, const btVector3& colour) {
    const Field& field = shape.collider().field();
    const glm::vec3 origin(dataOf(field).origin);
    const float edge = float(FieldFrame::side) * field.voxelSize();
    const auto place = [&](const glm::ivec3& corner) {
        return toBullet(here.pose.toWorld(here.scale * (origin + edge * glm::vec3(corner))));
    };
    for (int axis = 0; axis < 3; ++axis)
        visitOutline(field, axis, [&](const glm::ivec3& from, const glm::ivec3& to) {
            drawer.drawLine(place(from), place(to), colour);
        });
}

void drawPoints(const Shape& shape, const Placed& here, btIDebugDraw& drawer, const DrawOptions& options) {
    for (const SurfacePoint& point : dataOf(shape.collider()).points().points()) {
        const glm::vec3 from = here.pose.toWorld(here.scale * point.position);
        const glm::vec3 to = from + normalVoxels * shape.voxelSize() * (here.pose.rotation * point.normal);
        drawer.drawLine(toBullet(from), toBullet(to), point.isSharp ? options.sharpColour : options.pointColour);
    }
}

void drawShape(const btCollisionShape& shape, const btTransform& transform, btIDebugDraw& drawer,
               const DrawOptions& options) {
    if (const auto* field = dynamic_cast<const Shape*>(&shape)) return drawField(*field, transform, drawer, options);
    const auto* compound = dynamic_cast<const btCompoundShape*>(&shape);
    for (int i = 0; compound && i < compound->getNumChildShapes(); ++i)
        drawShape(*compound->getChildShape(i), transform * compound->getChildTransform(i), drawer, options);
}

}  // namespace

void drawField(const Shape& shape, const btTransform& transform, btIDebugDraw& drawer, const DrawOptions& options) {
    const Placed here = shape.placed(transform);
    if (options.band) drawBand(shape, here, drawer, options.bandColour);
    if (options.points) drawPoints(shape, here, drawer, options);
}

void drawFields(const btCollisionWorld& world, btIDebugDraw& drawer, const DrawOptions& options) {
    const btCollisionObjectArray& objects = world.getCollisionObjectArray();
    for (int i = 0; i < objects.size(); ++i)
        drawShape(*objects[i]->getCollisionShape(), objects[i]->getWorldTransform(), drawer, options);
}

}  // namespace bilayer::bullet
