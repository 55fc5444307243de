// SPDX-License-Identifier: Apache-2.0
// The shapes in a compound, and in the compounds within it.
// Tested by tests/bullet/smooth_ground.cpp and tests/bullet/continuous_collision.cpp through WorldExtensions.
#pragma once

#include <BulletCollision/CollisionShapes/btCompoundShape.h>

namespace bilayer::bullet::detail {

/// Whether any shape that is no compound passes a test: of the compound's children and theirs, or the shape itself.
/// @param at    pose of the shape
/// @param test  (const btCollisionShape&, const btTransform& pose) -> bool
template <class Test>
bool anyLeafShape(const btCollisionShape& shape, const btTransform& at, Test&& test) {
    if (!shape.isCompound()) return test(shape, at);
    const auto& compound = static_cast<const btCompoundShape&>(shape);
    for (int i = 0; i < compound.getNumChildShapes(); ++i)
        if (anyLeafShape(*compound.getChildShape(i), at * compound.getChildTransform(i), test)) return true;
    return false;
}

/// Visits all of these shapes.
/// @param visit  (const btCollisionShape&, const btTransform& pose)
template <class Visit>
void visitLeafShapes(const btCollisionShape& shape, const btTransform& at, Visit&& visit) {
    anyLeafShape(shape, at, [&](const btCollisionShape& leaf, const btTransform& pose) {
        visit(leaf, pose);
        return false;
    });
}

}  // namespace bilayer::bullet::detail
