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

BodySweep::BodySweep(btCollisionObject& object, float seconds)
    : object_(object), end_(object.getWorldTransform()), start_(end_.getOrigin()), orientation_(end_.getRotation()) {
    body_ = activeDynamicBody(object);
    // a body that Bullet's own CCD has stopped keeps its velocity, but its displacement is unknown
    if (!body_ || body_->getHitFraction() < 1) return;
    way_ = seconds * body_->getLinearVelocity();
    start_ -= way_;
    const btVector3& spin = body_->getAngularVelocity();
    const float angle = seconds * spin.length();
    if (!(angle > 0)) return;
    axis_ = spin.normalized();
    // beyond its limit, Bullet rotates by another angle than that of the angular velocity, but about the same axis
    const float most = ANGULAR_MOTION_THRESHOLD;
    turn_ = angle > most ? 2 * std::atan(angle / most * std::tan(most / 2)) : angle;
}

btTransform BodySweep::at(float time) const {
    if (!body_ || std::min(time, part_) >= 1) return end_;
    const float gone = std::min(time, part_), left = 1 - gone;
    const btTransform back(btQuaternion(axis_, -left * turn_));
    return btTransform((back.getRotation() * orientation_).normalized(), start_ + gone * way_);
}

float BodySweep::radius() const {
    btVector3 centre;
    btScalar radius;
    object_.getCollisionShape()->getBoundingSphere(centre, radius);
    return centre.length() + radius;
}

float BodySweep::longest(const BodySweep& other) const {
    return (way_ - other.way_).length() + radius() * turn_ + other.radius() * other.turn_;
}

void BodySweep::box(btVector3& lower, btVector3& upper) const {
    const float r = radius();
    lower = upper = start_;
    lower.setMin(start_ + way_);
    upper.setMax(start_ + way_);
    lower -= btVector3(r, r, r);
    upper += btVector3(r, r, r);
}

bool BodySweep::holdAt(float part) {
    if (!body_ || part >= part_) return false;
    part_ = part;
    return true;
}

bool BodySweep::apply() const {
    if (part_ >= 1) return false;
    body_->setCenterOfMassTransform(at(part_));
    return true;
}

}  // namespace bilayer::bullet::detail
