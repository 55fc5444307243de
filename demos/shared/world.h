// A Bullet world whose bodies collide by their fields: the few lines that every program with bilayer in Bullet has.
#pragma once

#include <BulletCollision/BroadphaseCollision/btDbvtBroadphase.h>
#include <BulletCollision/CollisionDispatch/btDefaultCollisionConfiguration.h>
#include <BulletDynamics/ConstraintSolver/btSequentialImpulseConstraintSolver.h>
#include <BulletDynamics/Dynamics/btDiscreteDynamicsWorld.h>
#include <BulletDynamics/Dynamics/btRigidBody.h>

#include <memory>
#include <vector>

#include <bilayer/collider/contact.h>
#include <bilayer/collider/pose.h>
#include <bilayer/integration/bullet/dispatcher.h>
#include <bilayer/integration/bullet/extensions.h>
#include <bilayer/integration/bullet/shape.h>

namespace bilayer::demo {

using namespace bilayer::detail;

/// What bodies are made of.
struct Matter {
    float mass = 0;  ///< 0: it never moves [kg]
    float friction = 0.5f;
    float rollingFriction = 0;  ///< [m]
    float restitution = 0;
    /// What air and soft surfaces take: a share of the speed and of the spin a second.
    float linearDamping = 0.05f, angularDamping = 0.2f;
    /// Slower than this for two seconds, bodies that touch fall asleep together [m/s], [rad/s]. Bullet's own thresholds
    /// (0.8 m/s, 1 rad/s) are for crates and cars: small things that still roll would freeze.
    float restingSpeed = 0.1f, restingSpin = 1;
};

/// Of a body that moves, by translation and rotation [J].
double kineticEnergyOf(const btRigidBody& body);

/// Bodies, in the order in which they were added, under gravity along -z.
class World {
  public:
    World();
    ~World();

    /// Adds a body whose mesh stands at a pose: a bullet::Shape's where its collider does, any other shape's in the
    /// shape's own coordinates. Several bodies may share a shape.
    btRigidBody& add(std::shared_ptr<btCollisionShape> shape, const Matter& matter, const Pose& pose);

    /// One step of fixed length [s].
    void step(float seconds);

    /// Where the meshes are, as they were modelled.
    std::vector<Pose> poses() const;

    /// Bodies that move, and those of them that have come to rest.
    int moving() const;
    int asleep() const;

    /// Of all bodies that move, asleep or not; potential energy is 0 at the origin [J].
    double kineticEnergy() const;
    double potentialEnergy() const;

    /// For constraints, rays and whatever else Bullet offers.
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
    bullet::WorldExtensions extensions_{world_};
    std::vector<Body> bodies_;
};

}  // namespace bilayer::demo
