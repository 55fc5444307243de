// SPDX-License-Identifier: Apache-2.0
#include "integration/bullet/detail/body_sweep.h"

#include <BulletCollision/CollisionShapes/btCollisionShape.h>
#include <LinearMath/btTransformUtil.h>

#include <cmath>
#include <glm/common.hpp>

#include "integration/bullet/detail/convert.h"

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

namespace {

/// The motion of a body in the step that has ended. A body that Bullet's own CCD has stopped keeps its velocity, but
/// its displacement is unknown.
Motion motionOf(const btRigidBody* body, float seconds) {
    if (!body || body->getHitFraction() < 1) return {};
    const glm::vec3 displacement = toGlm(seconds * body->getLinearVelocity());
    const btVector3& spin = body->getAngularVelocity();
    const float angle = seconds * spin.length();
    if (!(angle > 0)) return {displacement};
    // beyond its limit, Bullet rotates by another angle than that of the angular velocity, but about the same axis
    const float maxAngle = ANGULAR_MOTION_THRESHOLD;
    const float rotated = angle > maxAngle ? 2 * std::atan(angle / maxAngle * std::tan(maxAngle / 2)) : angle;
    return {displacement, toGlm(rotated * spin.normalized())};
}

}  // namespace

BodySweep::BodySweep(btCollisionObject& object, float seconds)
    : object_(object),
      body_(activeDynamicBody(object)),
      sweep_(Sweep::endingAt(toPose(object.getWorldTransform()), motionOf(body_, seconds))) {}

float BodySweep::maxDisplacement(const BodySweep& other) const {
    return float(
        maxApproach(sweep_, double(boundingRadius(object_)), other.sweep_, double(boundingRadius(other.object_))));
}

void BodySweep::box(btVector3& lower, btVector3& upper) const {
    const float r = boundingRadius(object_);
    const glm::vec3 from(sweep_.start()), to(sweep_.start() + sweep_.displacement());
    lower = toBullet(glm::min(from, to) - r);
    upper = toBullet(glm::max(from, to) + r);
}

bool BodySweep::stopAt(float time) {
    if (!body_ || time >= stopTime()) return false;
    sweep_.stopAt(double(time));
    return true;
}

bool BodySweep::apply() const {
    if (stopTime() >= 1) return false;
    const Pose pose = sweep_.at(1);
    body_->setCenterOfMassTransform(btTransform(toBullet(pose.rotation), toBullet(pose.position)));
    return true;
}

}  // namespace bilayer::bullet::detail
