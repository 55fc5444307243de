// SPDX-License-Identifier: Apache-2.0
// Pairs of placed shapes, at least one of them a collider.
// Tested by tests/collider/shapes.cpp through collide().
#pragma once

#include <bilayer/collider/contact.h>

namespace bilayer::detail {

/// Which of two shapes is the collider that is asked.
struct Order {
    bool both;       ///< both are colliders
    bool isSwapped;  ///< only the first one is
};

/// Throws std::invalid_argument for a rotation that is no unit quaternion. One that is not a number passes: such bodies
/// have no contacts.
void requireUnitRotation(const Pose& pose);

/// Throws std::invalid_argument if neither is a collider, a scale is not positive, or a rotation is no unit quaternion.
Order orderOf(const PlacedShape& a, const PlacedShape& b);

/// For a shape that is a collider.
inline Placed placed(const PlacedShape& body) {
    return {*body.shape.collider(), body.pose, body.scale, body.motion};
}

}  // namespace bilayer::detail
