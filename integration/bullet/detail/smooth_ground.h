// SPDX-License-Identifier: Apache-2.0
// Smooth ground: bodies that slide or roll over triangles keep their energy.
// Tested by tests/bullet/smooth_ground.cpp.
#pragma once

#include <BulletDynamics/Dynamics/btDynamicsWorld.h>
#include <BulletDynamics/Dynamics/btRigidBody.h>

#include <map>
#include <utility>

#include "integration/bullet/detail/recorded_states.h"
#include "integration/bullet/detail/velocity.h"

namespace bilayer::bullet::detail {

/// An impact on a triangle of the ground, in the direction of the contact normal.
struct FacetImpact {
    float impulse;   ///< [N s]
    float before;    ///< velocity of the contact point before the step, without the forces of the step [m/s]
    float after;     ///< the same after the step [m/s]
    float speed;     ///< of the body's centre along the triangle, before the step [m/s]
    float mobility;  ///< the contact point's inverse effective mass times the body's mass; 1 in line with the centre
    float arm;       ///< distance of the contact point from the body's centre [m]
    float gravity;   ///< towards the triangle [m/s^2]
    float rotationSpeed;  ///< what the body's rotation contributes to `before` [m/s]

    /// The energy that the impact takes, up to what edges whose angles sum to this can cause [J]. Negative: it adds
    /// energy. The edges deflect the body, and it tips over them.
    float loss(float angle) const;

  private:
    float tipping(float angle) const;
};

/// The friction of a body at a contact with a triangle of the ground, in one step.
struct FacetFriction {
    btVector3 impulse;        ///< on the body [N s]
    btVector3 before, after;  ///< velocities of the contact point along the triangle, as those of FacetImpact [m/s]
    float speed;              ///< of the body's centre along the triangle, before the step [m/s]

    /// The energy that the friction takes from a body that rolls over edges whose angles sum to this [J]. The angle
    /// moves the contact point away from where it would be on a smooth surface. So the point slips along the triangle
    /// at up to speed * (1 - cos(angle)), and impacts there change the rotation by as much. 0 for a body that slips
    /// faster.
    float loss(float angle) const;
};

/// Gives bodies back what shallow edges of the ground and their own take: ExtensionOptions::smoothGround.
class SmoothGround {
  public:
    explicit SmoothGround(btDynamicsWorld& world) : world_(world) {}

    void beforeStep();
    /// Does nothing without beforeStep().
    void afterStep(float seconds);

  private:
    using Ground = std::pair<const btRigidBody*, const btCollisionObject*>;  ///< a body and the ground under it
    float edgeAngleUnder(const Ground& ground);
    float lossIn(const btPersistentManifold& manifold, const Ground& ground, float seconds);

    btDynamicsWorld& world_;
    RecordedStates<Velocity> before_;     ///< only active bodies have a velocity
    std::map<Ground, float> edgeAngles_;  ///< those asked for in this step [rad]
};

}  // namespace bilayer::bullet::detail
