// Contacts between a field and the shapes that Bullet brings along. Body A is the other shape, body B the field. Beyond
// the margin there are contacts, too, where a point's motion meets the other body. Motions are about the poses'
// positions; a plane's is about the world's origin.
#pragma once

#include <BulletCollision/CollisionShapes/btConcaveShape.h>

#include <span>
#include <vector>

#include <bilayer/collider/collider.h>
#include <bilayer/collider/contact.h>
#include "collider/contact/sampled_contacts.h"
#include "integration/bullet/detail/convex.h"

namespace bilayer::bullet::detail {

using namespace bilayer::detail;

/// Two fields, without the contacts whose normals look along the surface they touch: those of points just under the
/// edge of the other body.
/// @param measured  as in ContactOptions
/// @param near      kept for this pair of bodies from step to step
ContactReport collideFields(const Placed& a, const Placed& b, float margin, bool measured, ContactCache& cache,
                            std::vector<Contact>& contacts);

/// The same of the points that a sampler has found of A in B's field, and of B in A's.
ContactReport collideFields(const Placed& a, const Placed& b, float margin, std::span<const FoundPoint> ofA,
                            std::span<const FoundPoint> ofB, std::vector<Contact>& contacts);

/// Against everything below a plane.
/// @param normal, offset  in the world: dot(normal, x) <= offset is solid; `normal` of unit length
/// @param measured        whether the lowest vertex of the mesh makes a contact, too
ContactReport collidePlane(const glm::vec3& normal, float offset, const Motion& motion, const Placed& field,
                           float margin, bool measured, std::vector<Contact>& contacts);

/// Against a convex body: the field's surface points against its formula, then its own points in the field.
/// @param measured  as in ContactOptions; the places between surface points count where faces touch as well, which
///                  beside sharp edges would shake what rests
ContactReport collideConvex(const Convex& convex, const Pose& pose, const Motion& motion, const Placed& field,
                            float margin, bool measured, std::vector<Contact>& contacts);

/// Against the triangles of a mesh or a height field, from both sides: a triangle is a sheet.
/// @param measured  as in ContactOptions
ContactReport collideTriangles(const btConcaveShape& mesh, const btTransform& transform, const Motion& motion,
                               const Placed& field, float margin, bool measured, std::vector<Contact>& contacts);

}  // namespace bilayer::bullet::detail
