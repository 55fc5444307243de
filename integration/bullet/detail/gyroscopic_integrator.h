// SPDX-License-Identifier: Apache-2.0
// Gyroscopic integrator: rigid bodies that rotate by Euler's equations.
#pragma once

#include <BulletDynamics/Dynamics/btDynamicsWorld.h>
#include <BulletDynamics/Dynamics/btRigidBody.h>

#include <vector>

namespace bilayer::bullet::detail {

/// Conserves angular momentum: ExtensionOptions::gyroscopicIntegration.
class GyroscopicIntegrator {
  public:
    explicit GyroscopicIntegrator(btDynamicsWorld& world) : world_(world) {}

    void beforeStep(float seconds);
    void afterStep();

  private:
    struct RotatingBody {
        int index;  // in the world's array of objects
        btRigidBody* body;
        btMatrix3x3 axes;           // before the step
        btVector3 momentum;         // before the step [kg m^2 / s]
        btVector3 midStepVelocity;  // angular velocity in the middle of the step, without external torques [rad/s]
    };

    btDynamicsWorld& world_;
    std::vector<RotatingBody> bodies_;
};

}  // namespace bilayer::bullet::detail
