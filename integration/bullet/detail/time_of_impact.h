// SPDX-License-Identifier: Apache-2.0
// Time of impact of two shapes in a step.
// Tested by tests/bullet/continuous_collision.cpp.
#pragma once

#include <BulletCollision/CollisionShapes/btCompoundShape.h>

#include <glm/vec3.hpp>

#include <bilayer/integration/bullet/shape.h>
#include "integration/bullet/detail/body_sweep.h"

namespace bilayer::bullet::detail {

using namespace bilayer::detail;

/// A shape other than a compound, and its pose in its object.
struct LeafShape {
    const btCollisionShape* shape;
    btTransform local;

    const Shape* field() const {
        if (shape->getShapeType() != FAST_CONCAVE_MESH_PROXYTYPE) return nullptr;
        const auto* field = static_cast<const Shape*>(shape);
        return field->speculative() ? field : nullptr;
    }
};

/// @param found  callback (const LeafShape&)
template <class Found>
void visitLeafShapes(const btCollisionShape* shape, const btTransform& local, Found&& found) {
    if (!shape->isCompound()) return found(LeafShape{shape, local});
    const auto* compound = static_cast<const btCompoundShape*>(shape);
    for (int i = 0; i < compound->getNumChildShapes(); ++i)
        visitLeafShapes(compound->getChildShape(i), local * compound->getChildTransform(i), found);
}

template <class Found>
void visitLeafShapes(const btCollisionObject& object, Found&& found) {
    visitLeafShapes(object.getCollisionShape(), btTransform::getIdentity(), found);
}

/// The time of impact: when and where a body first penetrates a surface too deeply, with the outward normal of that
/// surface.
struct Impact {
    float time = 1;  ///< 1: no impact in this step
    glm::vec3 place{0}, normal{0};

    Impact reversed() const { return {time, place, -normal}; }
};

inline Impact earlier(const Impact& one, const Impact& other) {
    return other.time < one.time ? other : one;
}

/// The first impact of a field and another shape; the normal is that of the other shape.
Impact timeOfImpact(const LeafShape& fieldShape, const BodySweep& fieldSweep, const LeafShape& other,
                    const BodySweep& otherSweep);

}  // namespace bilayer::bullet::detail
