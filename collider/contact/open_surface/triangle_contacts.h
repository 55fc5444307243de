// SPDX-License-Identifier: Apache-2.0
// Contacts between a field, body B, and an open surface, body A. Speculative contacts beyond the margin are made where
// a point's motion meets the other body.
// Tested by tests/bullet/open_surface.cpp.
#pragma once

#include <vector>

#include <bilayer/collider/contact.h>
#include "collider/contact/open_surface/open_surface.h"

namespace bilayer::detail {

/// Collides a field with the two-sided triangles of a mesh or a height field, which is an open surface.
/// @param motion  about the position of the pose
ContactReport collideTriangles(const OpenSurface& openSurface, const Pose& pose, const Motion& motion,
                               const Placed& field, const ContactOptions& options, std::vector<Contact>& contacts);

}  // namespace bilayer::detail
