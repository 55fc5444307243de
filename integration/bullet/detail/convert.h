// SPDX-License-Identifier: Apache-2.0
// Conversions between Bullet's vectors and GLM's.
// Tested by tests/bullet/pairs.cpp.
#pragma once

#include <LinearMath/btTransform.h>

#include <bilayer/collider/pose.h>

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

inline Pose toPose(const btTransform& t) {
    return {toGlm(t.getOrigin()), toGlm(t.getRotation())};
}

}  // namespace bilayer::bullet::detail
