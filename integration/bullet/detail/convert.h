// SPDX-License-Identifier: Apache-2.0
// Conversions between Bullet's vectors and GLM's.
// Tested by tests/bullet/convex.cpp.
#pragma once

#include <LinearMath/btTransform.h>

#include <cmath>

#include <bilayer/collider/pose.h>
#include "sdf/base/unit_tolerance.h"

namespace bilayer::bullet::detail {

inline glm::vec3 toGlm(const btVector3& v) {
    return {v.x(), v.y(), v.z()};
}
inline btVector3 toBullet(const glm::vec3& v) {
    return {v.x, v.y, v.z};
}

inline glm::quat toGlm(const btQuaternion& q) {
    return {q.w(), q.x(), q.y(), q.z()};
}
inline btQuaternion toBullet(const glm::quat& q) {
    return {q.x, q.y, q.z, q.w};
}

/// A basis that is no rotation gives that of the nearest unit quaternion.
inline btTransform toBullet(const Pose& pose) {
    const auto& [p, q] = pose;
    return btTransform(btQuaternion(q.x, q.y, q.z, q.w), btVector3(p.x, p.y, p.z));
}
inline Pose toPose(const btTransform& t) {
    const glm::quat rotation = toGlm(t.getRotation());
    const bool isUnit = std::abs(glm::dot(rotation, rotation) - 1) < bilayer::detail::unitTolerance;
    return {toGlm(t.getOrigin()), isUnit ? rotation : glm::normalize(rotation)};
}

}  // namespace bilayer::bullet::detail
