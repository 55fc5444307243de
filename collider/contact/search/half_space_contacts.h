// SPDX-License-Identifier: Apache-2.0
// Contacts between a field, body B, and a half-space, body A. Its motion is about the world's origin. Speculative
// contacts beyond the margin are made where a point's motion meets the half-space.
// Tested by tests/collider/shapes.cpp through collide().
#pragma once

#include <vector>

#include <bilayer/collider/contact.h>
#include "collider/contact/shapes/shape_data.h"

namespace bilayer::detail {

/// Collides a field with a half-space in world coordinates. With ContactOptions::exact, the lowest vertex of the mesh
/// also makes a contact.
ContactReport collideHalfSpace(const HalfSpace& solid, const Motion& motion, const Placed& field,
                               const ContactOptions& options, std::vector<Contact>& contacts);

}  // namespace bilayer::detail
