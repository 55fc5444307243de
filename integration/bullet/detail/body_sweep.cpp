// SPDX-License-Identifier: Apache-2.0
#include "integration/bullet/detail/body_sweep.h"

#include <BulletCollision/CollisionShapes/btCollisionShape.h>
#include <LinearMath/btTransformUtil.h>

#include <algorithm>
#include <cmath>

namespace bilayer::bullet::detail {

btRigidBody* activeDynamicBody(btCollisionObject& object) {
    auto* body = btRigidBody::upcast(&object);
    return body && !body->isStaticOrKinematicObject() && body->isActive() ? body : nullptr;
}

float boundingRadius(const btCollisionObject& object) {
    btVector3 centre;
    btScalar radius;
    object.getCollisionShape()->getBoundingSphere(centre, radius);
    return centre.length() + radius;
}

BodySweep::BodySweep(btCollisionObject& object, float seconds)
    : object_(object), end_(object.getWorldTransform()), start_(end_.getOrigin()), orientation_(end_.getRotation()) {
    body_ = activeDynamicBody(object);
    // a body that Bullet's own CCD has stopped keeps its velocity, but its displacement is unknown
    if (!body_ || body_->getHitFraction() < 1) return;
    displacement_ = seconds * body_->getLinearVelocity();
    start_ -= displacement_;
    const btVector3& spin = body_->getAngularVelocity();
    const float angle = seconds * spin.length();
    if (!(angle > 0)) return;
    axis_ = spin.normalized();
    // beyond its limit, Bullet rotates by another angle than that of the angular velocity, but about the same axis
    const float maxAngle = ANGULAR_MOTION_THRESHOLD;
    angle_ = angle > maxAngle ? 2 * std::atan(angle / maxAngle * std::tan(maxAngle / 2)) : angle;
}

btTransform BodySweep::at(float time) const {
    if (!body_ || std::min(time, stopTime_) >= 1) return end_;
    const float elapsed = std::min(time, stopTime_), left = 1 - elapsed;
    const btTransform back(btQuaternion(axis_, -left * angle_));
    return btTransform((back.getRotation() * orientation_).normalized(), start_ + elapsed * displacement_);
}

float BodySweep::maxDisplacement(const BodySweep& other) const {
    return (displacement_ - other.displacement_).length() + radius() * angle_ + other.radius() * other.angle_;
}

void BodySweep::box(btVector3& lower, btVector3& upper) const {
    const float r = radius();
    lower = upper = start_;
    lower.setMin(start_ + displacement_);
    upper.setMax(start_ + displacement_);
    lower -= btVector3(r, r, r);
    upper += btVector3(r, r, r);
}

bool BodySweep::stopAt(float time) {
    if (!body_ || time >= stopTime_) return false;
    stopTime_ = time;
    return true;
}

bool BodySweep::apply() const {
    if (stopTime_ >= 1) return false;
    body_->setCenterOfMassTransform(at(stopTime_));
    return true;
}

}  // namespace bilayer::bullet::detail
