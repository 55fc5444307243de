// SPDX-License-Identifier: Apache-2.0
#include "integration/bullet/detail/rest_stabilisation.h"

#include <BulletDynamics/ConstraintSolver/btTypedConstraint.h>
#include <BulletDynamics/Dynamics/btRigidBody.h>
#include <LinearMath/btTransformUtil.h>

#include <algorithm>
#include <cstddef>
#include <limits>
#include <unordered_map>
#include <vector>

#include "integration/bullet/detail/body_sweep.h"

namespace bilayer::bullet::detail {

namespace {

// Thresholds [fractions of the speed that gravity adds in a step]. A body slower than `restSpeed` that gets no faster
// has not moved. A held body stays until it is faster than `releaseSpeed`, or until something has pushed it: its
// velocity has changed by `pushSpeed` for `pushSteps` steps, since the solver's residual may jump as far from any step
// to the next.
constexpr float restSpeed = 0.05f, releaseSpeed = 0.15f, pushSpeed = 0.05f;
constexpr int pushSteps = 4;
// Rounding limit, relative: of positions in single precision to their size, of rotations [rad], and of forces to the
// weight.
constexpr float restRounding = 4 * std::numeric_limits<float>::epsilon();

bool isDynamic(const btCollisionObject& object) {
    return btRigidBody::upcast(&object) && !object.isStaticOrKinematicObject();
}

// Whether a force other than its weight acts.
bool isForced(const btRigidBody& body) {
    const btVector3 weight = body.getGravity() / body.getInvMass() * body.getLinearFactor();
    return body.getTotalForce().distance(weight) > restRounding * weight.length() || !body.getTotalTorque().isZero();
}

// Bullet applies no gravity to bodies that it wakes within a step.
bool isWithoutForce(const btRigidBody& body) {
    return body.getTotalForce().isZero() && body.getTotalTorque().isZero();
}

Velocities operator-(const Velocities& a, const Velocities& b) {
    return {a.linear - b.linear, a.angular - b.angular};
}

Velocities velocitiesOf(const btRigidBody& body) {
    return {body.getLinearVelocity(), body.getAngularVelocity()};
}

// Speed of a body's farthest point, in fractions of the speed that gravity adds in a step.
float speedOf(const btRigidBody& body, const Velocities& velocities, float seconds) {
    const float speed = velocities.linear.length() + boundingRadius(body) * velocities.angular.length();
    return speed / (seconds * body.getGravity().length());
}

// Change of a body's velocity, in the same unit.
float changeOf(const btRigidBody& body, const Velocities& before, float seconds) {
    return speedOf(body, velocitiesOf(body) - before, seconds);
}

// Whether a body has come from a pose by its velocity alone, and was not moved by the user or the solver.
bool comesFrom(const btTransform& place, const btRigidBody& body, float seconds) {
    btTransform expected;
    btTransformUtil::integrateTransform(place, body.getLinearVelocity(), body.getAngularVelocity(), seconds, expected);
    const btTransform& now = body.getWorldTransform();
    const float size = std::max(now.getOrigin().length(), expected.getOrigin().length());
    if (!(now.getOrigin().distance(expected.getOrigin()) <= restRounding * size)) return false;
    for (int axis = 0; axis < 3; ++axis)
        if (!(now.getBasis().getColumn(axis).distance(expected.getBasis().getColumn(axis)) <= restRounding))
            return false;
    return true;
}

}  // namespace

bool RestStabilisation::stays(ObjectState& state, const btRigidBody& body, float seconds) {
    if (state.object != &body || !comesFrom(state.transform, body, seconds)) return false;
    const float speed = speedOf(body, velocitiesOf(body), seconds);
    if (!state.isHeld) return speed < restSpeed && speed <= state.speed;
    const bool isUnpushed = changeOf(body, state.beforePush, seconds) < pushSpeed;
    const bool isSteady = changeOf(body, state.last, seconds) < pushSpeed;
    const bool hasGrown = speed >= releaseSpeed && speedOf(body, state.last - state.beforePush, seconds) >= pushSpeed;
    if (isUnpushed) state.beforePush = velocitiesOf(body);
    state.pushes = isUnpushed || !isSteady ? 0 : state.pushes + 1;
    return isUnpushed || hasGrown || (speed < releaseSpeed && state.pushes < pushSteps);
}

/// Holds a body at its pose. A released body gets the velocity that it had at first; otherwise an oscillating body
/// would gain energy at each reversal.
void RestStabilisation::hold(ObjectState& state, btRigidBody& body, float seconds) {
    const Velocities velocities = velocitiesOf(body);
    const float speed = speedOf(body, velocities, seconds);
    if (!state.isHeld) {
        state.beforePush = velocities;
        state.pushes = 0;
        state.speed = speed;
    }
    state.isHeld = speed < releaseSpeed;
    if (!state.isHeld) {
        body.setLinearVelocity(state.speed / speed * velocities.linear);
        body.setAngularVelocity(state.speed / speed * velocities.angular);
    }
    body.setCenterOfMassTransform(state.transform);
}

/// Whether anything but its weight moves an object, at any speed.
bool RestStabilisation::isDriven(const ObjectState& state, const btCollisionObject& object) {
    const bool moves = state.object == &object && !(state.transform == object.getWorldTransform());
    if (!isDynamic(object)) return moves;
    const btRigidBody& body = *btRigidBody::upcast(&object);
    if (body.getGravity().isZero()) return moves;
    return isForced(body) && !(state.sleeps && isWithoutForce(body));
}

/// The driven bodies, and the bodies that they carry.
std::unordered_set<const btCollisionObject*> RestStabilisation::driven() const {
    std::unordered_set<const btCollisionObject*> driven;
    std::vector<const btCollisionObject*> open;
    const auto add = [&](const btCollisionObject& object) {
        if (driven.insert(&object).second) open.push_back(&object);
    };
    for (int i = 0; i < world_.getNumConstraints(); ++i) {
        const btTypedConstraint* constraint = world_.getConstraint(i);
        for (const btRigidBody* body : {&constraint->getRigidBodyA(), &constraint->getRigidBodyB()})
            if (isDynamic(*body)) add(*body);
    }
    const btCollisionObjectArray& objects = world_.getCollisionObjectArray();
    for (int i = 0; i < objects.size(); ++i)
        if (isDriven(states_[std::size_t(i)], *objects[i])) add(*objects[i]);
    if (open.empty()) return driven;

    std::unordered_map<const btCollisionObject*, std::vector<const btCollisionObject*>> touching;
    for (int i = 0; i < world_.getDispatcher()->getNumManifolds(); ++i) {
        const btPersistentManifold& manifold = *world_.getDispatcher()->getManifoldByIndexInternal(i);
        const btCollisionObject *a = manifold.getBody0(), *b = manifold.getBody1();
        if (manifold.getNumContacts() == 0 || !a->hasContactResponse() || !b->hasContactResponse()) continue;
        touching[a].push_back(b);
        touching[b].push_back(a);
    }
    while (!open.empty()) {
        const btCollisionObject* carrier = open.back();
        open.pop_back();
        for (const btCollisionObject* carried : touching[carrier])
            if (isDynamic(*carried)) add(*carried);
    }
    return driven;
}

void RestStabilisation::afterStep(float seconds) {
    const btCollisionObjectArray& objects = world_.getCollisionObjectArray();
    states_.resize(std::size_t(objects.size()));
    const std::unordered_set<const btCollisionObject*> moving = driven();
    held_ = 0;
    for (int i = 0; i < objects.size(); ++i) {
        ObjectState& state = states_[std::size_t(i)];
        btRigidBody* const body = isDynamic(*objects[i]) ? btRigidBody::upcast(objects[i]) : nullptr;
        const bool sleeps = body && (!body->isActive() || (state.sleeps && isWithoutForce(*body)));
        if (body && body->isActive() && !moving.contains(body) && stays(state, *body, seconds)) {
            hold(state, *body, seconds);
            ++held_;
        } else {
            state = {.object = objects[i], .transform = objects[i]->getWorldTransform()};
            // a body that wakes up is at rest until something pushes it
            state.isHeld = body && !body->isActive();
            if (body) state.speed = speedOf(*body, velocitiesOf(*body), seconds);
        }
        state.sleeps = sleeps;
        if (body) state.last = velocitiesOf(*body);
    }
}

}  // namespace bilayer::bullet::detail
