// SPDX-License-Identifier: Apache-2.0
// A Bullet world whose bodies collide by their fields: the few lines that every program with bilayer and Bullet needs.
#pragma once

#include <BulletCollision/BroadphaseCollision/btDbvtBroadphase.h>
#include <BulletCollision/CollisionDispatch/btDefaultCollisionConfiguration.h>
#include <BulletDynamics/ConstraintSolver/btSequentialImpulseConstraintSolver.h>
#include <BulletDynamics/Dynamics/btDiscreteDynamicsWorld.h>
#include <BulletDynamics/Dynamics/btRigidBody.h>

#include <memory>
#include <vector>

#include <bilayer/collider/pose.h>
#include <bilayer/integration/bullet/dispatcher.h>
#include <bilayer/integration/bullet/extensions.h>
#include <bilayer/integration/bullet/shape.h>

namespace bilayer::demo {

/// Material and mass of a body.
struct Matter {
    float mass = 0;  ///< 0: a static body [kg]
    float friction = 0.5f;
    float rollingFriction = 0;  ///< [m]
    float restitution = 0;
    /// Damping by air and soft surfaces: the fraction of linear and angular velocity lost per second.
    float linearDamping = 0.05f, angularDamping = 0.2f;
    /// Touching bodies fall asleep together after two seconds below these speeds [m/s], [rad/s]. Bullet's own
    /// thresholds (0.8 m/s, 1 rad/s) suit crates and cars: small bodies would freeze while they still roll.
    float restingSpeed = 0.1f, restingSpin = 1;
};

/// Returns the kinetic energy of a dynamic body, of translation and rotation [J].
double kineticEnergyOf(const btRigidBody& body);

/// Bodies under gravity along -z, in the order of add().
class World {
  public:
    explicit World(const bullet::ExtensionOptions& extensions = {});
    ~World();

    /// Adds a body at the pose of its mesh: the mesh of the collider for a bullet::Shape, and the shape's own
    /// coordinates for any other shape. Several bodies may share a shape.
    btRigidBody& add(std::shared_ptr<btCollisionShape> shape, const Matter& matter, const Pose& pose);

    /// Advances one step of fixed length [s].
    void step(float seconds);

    /// Returns the poses of the original meshes.
    std::vector<Pose> poses() const;

    /// Count of dynamic bodies, and of those that are asleep.
    int moving() const;
    int asleep() const;

    /// Where the centre of mass was in the middle of the last step. Bullet moves a body through the whole step by the
    /// velocity at its end, so this is the position that belongs to the velocity: in free fall, energy is constant
    /// with it, and off by half of the weight's work in a step with the position at the end.
    btVector3 middleOfStep(const btRigidBody& body) const;

    /// Sums over all dynamic bodies, asleep or not, in the middle of the last step; potential energy is 0 at the
    /// origin [J].
    double kineticEnergy() const;
    double potentialEnergy() const;

    /// For constraints, rays and other features of Bullet.
    btDiscreteDynamicsWorld& bullet() { return world_; }
    const bullet::DispatchStatistics& statistics() const { return dispatcher_.statistics(); }

  private:
    struct Body {
        std::shared_ptr<btCollisionShape> shape;
        std::unique_ptr<btRigidBody> body;
    };
    btDefaultCollisionConfiguration configuration_;
    bullet::Dispatcher dispatcher_{&configuration_};
    btDbvtBroadphase broadphase_;
    btSequentialImpulseConstraintSolver solver_;
    btDiscreteDynamicsWorld world_{&dispatcher_, &broadphase_, &solver_, &configuration_};
    bullet::WorldExtensions extensions_;
    std::vector<Body> bodies_;
    float lastStep_ = 0;  // [s]
};

}  // namespace bilayer::demo
