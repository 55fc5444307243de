#include "integration/bullet/stillness.h"

#include <BulletCollision/CollisionShapes/btCollisionShape.h>
#include <BulletDynamics/ConstraintSolver/btTypedConstraint.h>
#include <BulletDynamics/Dynamics/btRigidBody.h>

#include <algorithm>
#include <cstddef>
#include <limits>
#include <unordered_set>

namespace bilayer::bullet {
namespace {

// What is slower has not moved [parts of the speed that gravity gives in a step].
constexpr float still = 0.01f;
// Places in single precision are rounded by no more than this part of their size, and turns by this [rad].
constexpr float rounding = 4 * std::numeric_limits<float>::epsilon();

// Bodies that constraints act on. Bullet itself knows some of them only.
std::unordered_set<const btRigidBody*> constrained(btDynamicsWorld& world) {
    std::unordered_set<const btRigidBody*> bodies;
    for (int i = 0; i < world.getNumConstraints(); ++i)
        bodies.insert({&world.getConstraint(i)->getRigidBodyA(), &world.getConstraint(i)->getRigidBodyB()});
    return bodies;
}

float radiusOf(const btRigidBody& body) {
    btVector3 centre;
    btScalar radius;
    body.getCollisionShape()->getBoundingSphere(centre, radius);
    return centre.length() + radius;
}

// Whether the step alone has brought a body from one place to the other, and the user has not.
bool isNext(const btTransform& before, const btTransform& now, float way, float radius) {
    const btVector3 &from = before.getOrigin(), &to = now.getOrigin();
    if (from.distance(to) > way + rounding * std::max(from.length(), to.length())) return false;
    for (int axis = 0; axis < 3; ++axis)
        if (before.getBasis().getColumn(axis).distance(now.getBasis().getColumn(axis)) > way / radius + rounding)
            return false;
    return true;
}

}  // namespace

Stillness::Stillness(btDynamicsWorld& world) : world_(world) {
    world_.addAction(this);
}

Stillness::~Stillness() {
    world_.removeAction(this);
}

void Stillness::updateAction(btCollisionWorld*, btScalar seconds) {
    const btCollisionObjectArray& objects = world_.getCollisionObjectArray();
    const std::unordered_set<const btRigidBody*> hung = constrained(world_);
    places_.resize(std::size_t(objects.size()), {nullptr, btTransform::getIdentity()});
    held_ = 0;
    for (int i = 0; i < objects.size(); ++i) {
        btRigidBody* const body = btRigidBody::upcast(objects[i]);
        Place& place = places_[std::size_t(i)];
        if (!body || body->isStaticOrKinematicObject() || !body->isActive() || hung.contains(body)) {
            place.body = nullptr;
            continue;
        }
        const float radius = radiusOf(*body), most = still * seconds * body->getGravity().length();
        const float speed = body->getLinearVelocity().length() + radius * body->getAngularVelocity().length();
        if (place.body == body && speed < most &&
            isNext(place.transform, body->getWorldTransform(), most * seconds, radius)) {
            body->setCenterOfMassTransform(place.transform);
            ++held_;
        } else {
            place = {body, body->getWorldTransform()};
        }
    }
}

}  // namespace bilayer::bullet
