// SPDX-License-Identifier: Apache-2.0
// Contacts between a field and other shapes. Body A is the other shape, body B the field. Speculative contacts beyond
// the margin are made where a point's motion meets the other body. Motions are about the positions of the poses; a
// plane's motion is about the world's origin.
// Tested by tests/bullet/edges.cpp.
#pragma once

#include <vector>

#include <bilayer/collider/contact.h>
#include <bilayer/collider/shapes.h>
#include "collider/contact/convex.h"
#include "collider/contact/shape_data.h"

namespace bilayer::detail {

/// Collides a field with a shape that is no collider.
ContactReport collideShape(const PlacedShape& shape, const Placed& field, const ContactOptions& options,
                           std::vector<Contact>& contacts);

/// Collides a field with a half-space in world coordinates. With ContactOptions::exact, the lowest vertex of the mesh
/// also makes a contact.
ContactReport collideHalfSpace(const HalfSpace& solid, const Motion& motion, const Placed& field,
                               const ContactOptions& options, std::vector<Contact>& contacts);

/// Collides a field with a convex body: first the field's surface points with the closed form of the convex body, then
/// the features of the convex body with the field. With ContactOptions::exact, probes between surface points also count
/// where faces touch; next to sharp edges they would make resting bodies jitter.
ContactReport collideConvex(const Convex& convex, const Pose& pose, const Motion& motion, const Placed& field,
                            const ContactOptions& options, std::vector<Contact>& contacts);

/// Collides a field with the two-sided triangles of a mesh or a height field, which is an open surface.
ContactReport collideTriangles(const OpenSurface& openSurface, const Pose& pose, const Motion& motion,
                               const Placed& field, const ContactOptions& options, std::vector<Contact>& contacts);

}  // namespace bilayer::detail
