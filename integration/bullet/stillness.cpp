#include "integration/bullet/stillness.h"

#include <BulletCollision/CollisionShapes/btCollisionShape.h>
#include <BulletDynamics/ConstraintSolver/btTypedConstraint.h>
#include <BulletDynamics/Dynamics/btRigidBody.h>
#include <LinearMath/btTransformUtil.h>

#include <algorithm>
#include <cstddef>
#include <limits>

namespace bilayer::bullet {
namespace {

// What is slower has not moved [parts of the speed that gravity gives in a step].
constexpr float still = 0.01f;
// Places in single precision are rounded by no more than this part of their size, turns by so much [rad], and forces by
// this part of the weight.
constexpr float rounding = 4 * std::numeric_limits<float>::epsilon();

bool isDynamic(const btCollisionObject& object) {
    return btRigidBody::upcast(&object) && !object.isStaticOrKinematicObject();
}

bool isPushed(const btRigidBody& body) {
    const btVector3 weight = body.getGravity() / body.getInvMass() * body.getLinearFactor();
    return body.getTotalForce().distance(weight) > rounding * weight.length() || !body.getTotalTorque().isZero();
}

float radiusOf(const btRigidBody& body) {
    btVector3 centre;
    btScalar radius;
    body.getCollisionShape()->getBoundingSphere(centre, radius);
    return centre.length() + radius;
}

bool isStill(const btRigidBody& body, float seconds) {
    const float speed = body.getLinearVelocity().length() + radiusOf(body) * body.getAngularVelocity().length();
    return speed < still * seconds * body.getGravity().length();
}

// Whether a body has come from a place by its speed alone: neither the user has put it where it is, nor has the solver.
bool comesFrom(const btTransform& place, const btRigidBody& body, float seconds) {
    btTransform expected;
    btTransformUtil::integrateTransform(place, body.getLinearVelocity(), body.getAngularVelocity(), seconds, expected);
    const btTransform& now = body.getWorldTransform();
    const float size = std::max(now.getOrigin().length(), expected.getOrigin().length());
    if (!(now.getOrigin().distance(expected.getOrigin()) <= rounding * size)) return false;
    for (int axis = 0; axis < 3; ++axis)
        if (!(now.getBasis().getColumn(axis).distance(expected.getBasis().getColumn(axis)) <= rounding)) return false;
    return true;
}

}  // namespace

Stillness::Stillness(btDynamicsWorld& world) : world_(world) {
    world_.addAction(this);
}

Stillness::~Stillness() {
    world_.removeAction(this);
}

/// What moves for a reason however slowly, and what it carries.
std::unordered_set<const btCollisionObject*> Stillness::driven() const {
    std::unordered_set<const btCollisionObject*> driven;
    for (int i = 0; i < world_.getNumConstraints(); ++i) {
        const btTypedConstraint* constraint = world_.getConstraint(i);
        for (const btRigidBody* body : {&constraint->getRigidBodyA(), &constraint->getRigidBodyB()})
            if (isDynamic(*body)) driven.insert(body);
    }
    const btCollisionObjectArray& objects = world_.getCollisionObjectArray();
    for (int i = 0; i < objects.size(); ++i) {
        const Place& place = places_[std::size_t(i)];
        const bool moves = place.body != objects[i] || !(place.transform == objects[i]->getWorldTransform());
        if (objects[i]->isKinematicObject() ? moves
                                            : isDynamic(*objects[i]) && isPushed(*btRigidBody::upcast(objects[i])))
            driven.insert(objects[i]);
    }
    for (std::size_t before = 0; before != driven.size();) {
        before = driven.size();
        for (int i = 0; i < world_.getDispatcher()->getNumManifolds(); ++i) {
            const btPersistentManifold& manifold = *world_.getDispatcher()->getManifoldByIndexInternal(i);
            const btCollisionObject *a = manifold.getBody0(), *b = manifold.getBody1();
            if (manifold.getNumContacts() == 0 || driven.contains(a) == driven.contains(b)) continue;
            if (const auto* other = driven.contains(a) ? b : a; isDynamic(*other)) driven.insert(other);
        }
    }
    return driven;
}

void Stillness::updateAction(btCollisionWorld*, btScalar seconds) {
    const btCollisionObjectArray& objects = world_.getCollisionObjectArray();
    places_.resize(std::size_t(objects.size()), {nullptr, btTransform::getIdentity()});
    const std::unordered_set<const btCollisionObject*> moving = driven();
    held_ = 0;
    for (int i = 0; i < objects.size(); ++i) {
        Place& place = places_[std::size_t(i)];
        btRigidBody* const body = isDynamic(*objects[i]) ? btRigidBody::upcast(objects[i]) : nullptr;
        if (body && body->isActive() && place.body == body && !moving.contains(body) && isStill(*body, seconds) &&
            comesFrom(place.transform, *body, seconds)) {
            body->setCenterOfMassTransform(place.transform);
            ++held_;
        } else {
            place = {objects[i], objects[i]->getWorldTransform()};
        }
    }
}

}  // namespace bilayer::bullet
