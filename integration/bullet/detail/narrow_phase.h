// SPDX-License-Identifier: Apache-2.0
// Contacts between a field and Bullet's own shapes. Body A is the other shape, body B the field. Speculative contacts
// beyond the margin are made where a point's motion meets the other body. Motions are about the positions of the poses;
// a plane's motion is about the world's origin.
// Tested by tests/bullet/edges.cpp.
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

/// Collides two fields. The normal filter removes contacts whose normals point along the surface that they touch: those
/// of points just under an edge of the other body.
/// @param exact  as ContactOptions::exact
/// @param cache     contact cache of this pair of bodies, kept from step to step
ContactReport collideFields(const Placed& a, const Placed& b, float margin, bool exact, ContactCache& cache,
                            std::vector<Contact>& contacts);

/// Collides two fields from the points that a sampler has found of A in B's field, and of B in A's.
ContactReport collideFields(const Placed& a, const Placed& b, float margin, std::span<const FoundPoint> ofA,
                            std::span<const FoundPoint> ofB, std::vector<Contact>& contacts);

/// Collides a field with the half-space below a plane.
/// @param normal, offset  in the world: dot(normal, x) <= offset is solid; `normal` of unit length
/// @param exact        whether the lowest vertex of the mesh also makes a contact
ContactReport collidePlane(const glm::vec3& normal, float offset, const Motion& motion, const Placed& field,
                           float margin, bool exact, std::vector<Contact>& contacts);

/// Collides a field with a convex body: first the field's surface points with the closed form of the convex body, then
/// the features of the convex body with the field.
/// @param exact  as ContactOptions::exact; probes between surface points then also count where faces touch. Next to
///                  sharp edges they would make resting bodies jitter
ContactReport collideConvex(const Convex& convex, const Pose& pose, const Motion& motion, const Placed& field,
                            float margin, bool exact, std::vector<Contact>& contacts);

/// Collides a field with the two-sided triangles of a mesh or a height field, which is an open surface.
/// @param exact  as ContactOptions::exact
ContactReport collideTriangles(const btConcaveShape& mesh, const btTransform& transform, const Motion& motion,
                               const Placed& field, float margin, bool exact, std::vector<Contact>& contacts);

}  // namespace bilayer::bullet::detail
