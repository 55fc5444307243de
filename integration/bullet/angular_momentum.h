// Bodies that spin as Euler's equations say.
#pragma once

#include <BulletDynamics/Dynamics/btDynamicsWorld.h>
#include <BulletDynamics/Dynamics/btRigidBody.h>

#include <vector>

namespace bilayer::bullet {

/// Keeps the angular momentum of bodies on which nothing acts, and to second order in the step their energy. Bullet
/// turns a body by its angular velocity and then corrects that one by a gyroscopic torque, to first order: a body that
/// turns over in free flight loses 10 % of its angular momentum a minute at 240 steps a second.
///
/// Here each step turns a body by the angular velocity that it has in the middle of it, found from its angular momentum
/// (the implicit midpoint rule: J. C. Simo, K. K. Wong, "Unconditionally stable algorithms for rigid body dynamics that
/// exactly preserve energy and momentum", Int. J. Numer. Meth. Engng. 31 (1991)). What contacts, constraints, torques
/// and damping do to a body in the step is added to its angular momentum.
class AngularMomentum {
  public:
    /// Looks after all bodies of a world, by its two tick callbacks, which are overwritten; the world must outlive
    /// this. Bullet's own gyroscopic torque is switched off, body by body.
    explicit AngularMomentum(btDynamicsWorld& world);
    ~AngularMomentum();
    AngularMomentum(const AngularMomentum&) = delete;
    AngularMomentum& operator=(const AngularMomentum&) = delete;

    /// What the callbacks call, for those who need callbacks of their own: before and after each internal step.
    void beforeStep(float seconds);
    void afterStep();

  private:
    struct Turning {
        int index;  // in the world's array of objects
        btRigidBody* body;
        btMatrix3x3 axes;    // before the step
        btVector3 momentum;  // before the step [kg m^2 / s]
        btVector3 midway;    // angular velocity in the middle of the step, if nothing acts [rad/s]
    };

    btDynamicsWorld& world_;
    std::vector<Turning> turning_;
};

}  // namespace bilayer::bullet
