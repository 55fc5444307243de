// SPDX-License-Identifier: Apache-2.0
#include "integration/bullet/detail/gyroscopic_integrator.h"

#include <BulletCollision/CollisionDispatch/btCollisionObject.h>
#include <LinearMath/btTransformUtil.h>

namespace bilayer::bullet::detail {

namespace {

// Each iteration reduces the error by about a factor of the body's rotation in a step [rad].
constexpr int iterations = 4;

constexpr int gyroscopic = BT_ENABLE_GYROSCOPIC_FORCE_EXPLICIT | BT_ENABLE_GYROSCOPIC_FORCE_IMPLICIT_WORLD |
                           BT_ENABLE_GYROSCOPIC_FORCE_IMPLICIT_BODY;

btVector3 momentumOf(const btRigidBody& body, const btMatrix3x3& axes, const btVector3& spin) {
    return axes * (axes.transpose() * spin / body.getInvInertiaDiagLocal());
}

btVector3 spinOf(const btRigidBody& body, const btMatrix3x3& axes, const btVector3& momentum) {
    return axes * (axes.transpose() * momentum * body.getInvInertiaDiagLocal());
}

btMatrix3x3 rotated(const btMatrix3x3& axes, const btVector3& by) {
    const btScalar angle = by.length();
    return angle > SIMD_EPSILON ? btMatrix3x3(btQuaternion(by / angle, angle)) * axes : axes;
}

bool rotates(const btRigidBody& body) {
    const btVector3& inverse = body.getInvInertiaDiagLocal();
    return !body.isStaticOrKinematicObject() && body.isActive() && inverse.x() > 0 && inverse.y() > 0 &&
           inverse.z() > 0;
}

}  // namespace

void GyroscopicIntegrator::beforeStep(float seconds) {
    bodies_.clear();
    const btCollisionObjectArray& objects = world_.getCollisionObjectArray();
    for (int i = 0; i < objects.size(); ++i) {
        btRigidBody* const body = btRigidBody::upcast(objects[i]);
        if (!body || !rotates(*body)) continue;
        body->setFlags(body->getFlags() & ~gyroscopic);
        const btMatrix3x3& axes = body->getWorldTransform().getBasis();
        const btVector3 momentum = momentumOf(*body, axes, body->getAngularVelocity());
        btVector3 midStepVelocity = body->getAngularVelocity();
        for (int k = 0; k < iterations; ++k)
            midStepVelocity = spinOf(*body, rotated(axes, seconds / 2 * midStepVelocity), momentum);
        body->setAngularVelocity(midStepVelocity);
        bodies_.push_back({i, body, axes, momentum, midStepVelocity});
    }
}

void GyroscopicIntegrator::afterStep() {
    const btCollisionObjectArray& objects = world_.getCollisionObjectArray();
    for (const auto& [index, body, axes, momentum, midStepVelocity] : bodies_) {
        // a user's callback may have removed it
        if (index >= objects.size() || objects[index] != body) continue;
        const btVector3 gained = momentumOf(*body, axes, body->getAngularVelocity() - midStepVelocity);
        body->setAngularVelocity(spinOf(*body, body->getWorldTransform().getBasis(), momentum + gained));
    }
    bodies_.clear();
}

}  // namespace bilayer::bullet::detail
