// SPDX-License-Identifier: Apache-2.0
#include "demos/shared/world.h"

#include "integration/bullet/detail/convert.h"

namespace bilayer::demo {

using namespace bilayer::detail;
using namespace bilayer::bullet::detail;
namespace {

constexpr float gravity = 9.81f;  // [m/s^2]

// Returns the frame of a shape's mesh in its body.
btTransform frameOf(const btCollisionShape& shape) {
    const auto* field = dynamic_cast<const bullet::Shape*>(&shape);
    return field ? toBullet(field->frame()) : btTransform::getIdentity();
}

}  // namespace

double kineticEnergyOf(const btRigidBody& body) {
    const btVector3 &v = body.getLinearVelocity(), &inverse = body.getInvInertiaDiagLocal();
    const btVector3 spin = body.getWorldTransform().getBasis().transpose() * body.getAngularVelocity();
    double energy = 0.5 * double(v.length2()) / double(body.getInvMass());
    for (int axis = 0; axis < 3; ++axis) energy += 0.5 * double(spin[axis]) * spin[axis] / double(inverse[axis]);
    return energy;
}

World::World(const bullet::ExtensionOptions& extensions) : extensions_(world_, extensions) {
    world_.setGravity({0, 0, -gravity});
    // with Bullet's single friction direction, a resting stack of rings drifts sideways until it falls
    world_.getSolverInfo().m_solverMode |= SOLVER_USE_2_FRICTION_DIRECTIONS;
}

World::~World() {
    for (const Body& body : bodies_) world_.removeRigidBody(body.body.get());
}

btRigidBody& World::add(std::shared_ptr<btCollisionShape> shape, const Matter& matter, const Pose& pose) {
    btVector3 inertia(0, 0, 0);
    if (matter.mass > 0) shape->calculateLocalInertia(matter.mass, inertia);
    btRigidBody::btRigidBodyConstructionInfo info(matter.mass, nullptr, shape.get(), inertia);
    // a body's origin is its centre of mass, but a mesh's is arbitrary; the shape's frame converts between the two
    info.m_startWorldTransform = toBullet(pose) * frameOf(*shape).inverse();
    info.m_friction = matter.friction;
    info.m_rollingFriction = matter.rollingFriction;
    info.m_restitution = matter.restitution;
    info.m_linearDamping = matter.linearDamping;
    info.m_angularDamping = matter.angularDamping;
    info.m_linearSleepingThreshold = matter.restingSpeed;
    info.m_angularSleepingThreshold = matter.restingSpin;
    bodies_.push_back({std::move(shape), std::make_unique<btRigidBody>(info)});
    world_.addRigidBody(bodies_.back().body.get());
    return *bodies_.back().body;
}

void World::step(float seconds) {
    lastStep_ = seconds;
    world_.stepSimulation(seconds, 1, seconds);
}

btVector3 World::middleOfStep(const btRigidBody& body) const {
    return body.getCenterOfMassPosition() - 0.5f * lastStep_ * body.getLinearVelocity();
}

std::vector<Pose> World::poses() const {
    std::vector<Pose> poses;
    for (const auto& [shape, body] : bodies_)
        poses.push_back(bullet::detail::toPose(body->getWorldTransform() * frameOf(*shape)));
    return poses;
}

int World::moving() const {
    int count = 0;
    for (const auto& [shape, body] : bodies_) count += !body->isStaticOrKinematicObject();
    return count;
}

int World::asleep() const {
    int count = 0;
    for (const auto& [shape, body] : bodies_) count += !body->isStaticOrKinematicObject() && !body->isActive();
    return count;
}

double World::kineticEnergy() const {
    double energy = 0;
    for (const Body& entry : bodies_)
        if (!entry.body->isStaticOrKinematicObject()) energy += kineticEnergyOf(*entry.body);
    return energy;
}

double World::potentialEnergy() const {
    double energy = 0;
    for (const Body& entry : bodies_) {
        const btRigidBody& body = *entry.body;
        if (body.isStaticOrKinematicObject()) continue;
        const btVector3& g = body.getGravity();
        const btVector3 at = middleOfStep(body);
        for (int axis = 0; axis < 3; ++axis) energy -= double(g[axis]) * at[axis] / double(body.getInvMass());
    }
    return energy;
}

}  // namespace bilayer::demo
