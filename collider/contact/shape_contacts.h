// SPDX-License-Identifier: Apache-2.0
// Contacts between a field and any shape that is no collider.
// Tested by tests/collider/shapes.cpp through collide().
#pragma once

#include <vector>

#include <bilayer/collider/contact.h>
#include <bilayer/collider/shapes.h>

namespace bilayer::detail {

/// Collides a field, body B, with a shape that is no collider, body A.
ContactReport collideShape(const PlacedShape& shape, const Placed& field, const ContactOptions& options,
                           std::vector<Contact>& contacts);

}  // namespace bilayer::detail
