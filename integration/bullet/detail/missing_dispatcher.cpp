// SPDX-License-Identifier: Apache-2.0
#include "integration/bullet/detail/missing_dispatcher.h"

#include <BulletCollision/CollisionDispatch/btCollisionObject.h>
#include <BulletCollision/CollisionDispatch/btConvexConcaveCollisionAlgorithm.h>

#include <atomic>
#include <cstdint>

#include "integration/bullet/detail/warning.h"

namespace bilayer::bullet::detail {

namespace {

std::atomic<int> fieldDispatchers{0};

using Address = std::uintptr_t;

Address addressOf(const btTransform& transform) {
    return reinterpret_cast<Address>(&transform);
}

/// Offset from a body's transform to its predicted transform in memory.
Address predictedOffset() {
    static const btCollisionObject object;
    return addressOf(object.getInterpolationWorldTransform()) - addressOf(object.getWorldTransform());
}

void warn() {
    warnOnce(
        "Bullet's own dispatcher does not know fields: they pass through other fields, planes, triangle meshes and "
        "height fields, and meet convex bodies with their triangles only; use bilayer::bullet::Dispatcher, or "
        "FieldAlgorithms with your dispatcher");
}

}  // namespace

FieldDispatcherMark::FieldDispatcherMark() {
    ++fieldDispatchers;
}

FieldDispatcherMark::~FieldDispatcherMark() {
    --fieldDispatchers;
}

void noteBox(const void* field, const btTransform& transform) {
    static thread_local const void* lastField = nullptr;
    static thread_local Address lastTransform = 0;
    if (fieldDispatchers > 0) return;
    if (field == lastField && addressOf(transform) == lastTransform + predictedOffset()) warn();
    lastField = field;
    lastTransform = addressOf(transform);
}

void noteTriangles(const btTriangleCallback& callback) {
    if (fieldDispatchers == 0 && dynamic_cast<const btConvexTriangleCallback*>(&callback)) warn();
}

}  // namespace bilayer::bullet::detail
