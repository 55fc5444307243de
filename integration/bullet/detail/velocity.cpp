// SPDX-License-Identifier: Apache-2.0
#include "integration/bullet/detail/velocity.h"

#include <BulletDynamics/Dynamics/btRigidBody.h>
#include <BulletDynamics/Featherstone/btMultiBodyLinkCollider.h>

#include <numeric>
#include <vector>

namespace bilayer::bullet::detail {

namespace {

/// A link's velocity, from the Jacobians that its constraints use.
Velocity velocityOf(const btMultiBodyLinkCollider& collider) {
    const btMultiBody& body = *collider.m_multiBody;
    Velocity velocity{.centre = collider.getWorldTransform().getOrigin()};
    std::vector<btScalar> jacobian(std::size_t(6 + body.getNumDofs()));
    btAlignedObjectArray<btScalar> scalars;
    btAlignedObjectArray<btVector3> vectors;
    btAlignedObjectArray<btMatrix3x3> matrices;
    const auto along = [&](const btVector3& rotation, const btVector3& translation) {
        body.fillConstraintJacobianMultiDof(collider.m_link, velocity.centre, rotation, translation, jacobian.data(),
                                            scalars, vectors, matrices);
        return std::inner_product(jacobian.begin(), jacobian.end(), body.getVelocityVector(), btScalar(0));
    };
    for (int axis = 0; axis < 3; ++axis) {
        btVector3 direction(0, 0, 0);
        direction[axis] = 1;
        velocity.linear[axis] = along({0, 0, 0}, direction);
        velocity.angular[axis] = along(direction, {0, 0, 0});
    }
    return velocity;
}

}  // namespace

Velocity velocityOf(const btCollisionObject& object) {
    // Bullet also calls a kinematic body without mass static.
    if (object.isStaticObject() && !object.isKinematicObject()) return {};
    if (const btRigidBody* body = btRigidBody::upcast(&object))
        return {body->getCenterOfMassPosition(), body->getLinearVelocity(), body->getAngularVelocity()};
    if (const auto* link = btMultiBodyLinkCollider::upcast(&object); link && link->m_multiBody)
        return velocityOf(*link);
    return {};
}

btVector3 accelerationOf(const btCollisionObject& object) {
    const btRigidBody* body = btRigidBody::upcast(&object);
    return body ? body->getInvMass() * body->getLinearFactor() * body->getTotalForce() : btVector3(0, 0, 0);
}

}  // namespace bilayer::bullet::detail
