// SPDX-License-Identifier: Apache-2.0
// Rest stabilisation: bodies at rest keep their positions.
// Tested by tests/bullet/rest_stabilisation.cpp through WorldExtensions.
#pragma once

#include <BulletDynamics/Dynamics/btDynamicsWorld.h>

#include <unordered_set>
#include <vector>

namespace bilayer::bullet::detail {

/// Velocities of a body.
struct Velocities {
    btVector3 linear{0, 0, 0}, angular{0, 0, 0};  ///< [m/s], [rad/s]
};

/// Holds bodies at rest: ExtensionOptions::restStabilisation.
class RestStabilisation {
  public:
    explicit RestStabilisation(btDynamicsWorld& world) : world_(world) {}

    void afterStep(float seconds);
    int restingBodies() const { return held_; }  ///< in the last step

  private:
    std::unordered_set<const btCollisionObject*> driven() const;

    /// Pose and velocity of an object at the end of the last step.
    struct ObjectState {
        const btCollisionObject* object = nullptr;
        btTransform transform = btTransform::getIdentity();
        Velocities last{};        ///< of the body, in the last step
        Velocities beforePush{};  ///< for a held body: before it was pushed
        int pushes = 0;           ///< steps since the push began
        /// Speed of the farthest point at the end of the last step; for a held body, when it was first held [fractions
        /// of the speed that gravity adds in a step].
        float speed = 0;
        bool isHeld = false;
        bool sleeps = false;  ///< or was woken after Bullet applied gravity to the bodies
    };
    static bool isDriven(const ObjectState& state, const btCollisionObject& object);
    static bool stays(ObjectState& state, const btRigidBody& body, float seconds);
    static void hold(ObjectState& state, btRigidBody& body, float seconds);

    btDynamicsWorld& world_;
    std::vector<ObjectState> states_;  ///< in the world's order
    int held_ = 0;
};

}  // namespace bilayer::bullet::detail
