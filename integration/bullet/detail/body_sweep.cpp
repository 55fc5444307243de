// SPDX-License-Identifier: Apache-2.0
#include "integration/bullet/detail/body_sweep.h"

#include <BulletCollision/CollisionShapes/btCollisionShape.h>

#include <algorithm>
#include <glm/common.hpp>

#include "integration/bullet/detail/convert.h"
#include "integration/bullet/detail/velocity.h"

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

BodySweep::BodySweep(btCollisionObject& object, const btTransform& start)
    : object_(object),
      body_(activeDynamicBody(object)),
      sweep_(Sweep::between(toPose(body_ ? start : object.getWorldTransform()), toPose(object.getWorldTransform()))) {}

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

void BodySweep::endForces(float seconds) const {
    const btVector3 velocity = body_->getLinearVelocity(), added = (1 - stopTime()) * seconds * accelerationOf(object_);
    const float along = added.dot(velocity);
    if (along > 0) body_->setLinearVelocity(velocity - std::min(along / added.length2(), 1.f) * added);
}

}  // namespace bilayer::bullet::detail
