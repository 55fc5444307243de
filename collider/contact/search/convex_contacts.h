// SPDX-License-Identifier: Apache-2.0
// Contacts between a field, body B, and a convex shape, body A. Speculative contacts beyond the margin are made where a
// point's motion meets the other body.
// Tested by tests/bullet/edges.cpp.
#pragma once

#include <vector>

#include <bilayer/collider/contact.h>
#include "collider/contact/shapes/convex.h"

namespace bilayer::detail {

/// Collides a field with a convex body: first the field's surface points with the closed form of the convex body, then
/// the features of the convex body with the field. With ContactOptions::exact, probes between surface points also count
/// where faces touch; next to sharp edges they would make resting bodies jitter.
/// @param motion  about the position of the pose
ContactReport collideConvex(const Convex& convex, const Pose& pose, const Motion& motion, const Placed& field,
                            const ContactOptions& options, std::vector<Contact>& contacts);

}  // namespace bilayer::detail
