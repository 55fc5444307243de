// SPDX-License-Identifier: Apache-2.0
// Pairs of placed shapes, at least one of them a collider.
// Tested by tests/collider/shapes.cpp through collide().
#pragma once

#include <bilayer/collider/contact.h>

namespace bilayer::detail {

/// Which of two shapes are colliders.
struct Order {
    bool both;       ///< both
    bool isSwapped;  ///< only the first one: swapped, the collider comes second
};

/// Throws std::invalid_argument for a rotation that is no unit quaternion. A rotation of NaN passes: such bodies have
/// no contacts.
void requireUnitRotation(const Pose& pose);

/// Throws std::invalid_argument if neither is a collider, a scale is not positive, or a rotation is no unit quaternion.
Order orderOf(const PlacedShape& a, const PlacedShape& b);

/// A placed shape that is a collider, as a placed collider.
inline Placed placed(const PlacedShape& body) {
    return {*body.shape.collider(), body.pose, body.scale, body.motion};
}

}  // namespace bilayer::detail
