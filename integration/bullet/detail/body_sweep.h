// SPDX-License-Identifier: Apache-2.0
// The sweep of an object over a step that has ended.
#pragma once

#include <BulletDynamics/Dynamics/btRigidBody.h>

#include "collider/contact/impact/sweep.h"

namespace bilayer::bullet::detail {

using namespace bilayer::detail;

/// The object as a body, if it is an active dynamic body of the world; null otherwise.
btRigidBody* activeDynamicBody(btCollisionObject& object);

/// Radius of a sphere about an object's origin that contains the object.
float boundingRadius(const btCollisionObject& object);

/// The sweep of an object over a step that has ended: its motion from the start to the end of the step.
class BodySweep {
  public:
    /// @param start  of the step
    BodySweep(btCollisionObject& object, const btTransform& start);

    const btCollisionObject& object() const { return object_; }
    const Sweep& sweep() const { return sweep_; }

    /// Upper bound of the displacement of its points.
    float maxDisplacement() const { return float(sweep_.maxDisplacement(double(boundingRadius(object_)))); }
    /// Upper bound of the displacement of its points in the frame of another object.
    float maxDisplacement(const BodySweep& other) const;
    /// Bounding box of the whole sweep.
    void box(btVector3& lower, btVector3& upper) const;

    btRigidBody* body() const { return body_; }
    /// The fraction of the step at which it is stopped; 1: not stopped.
    float stopTime() const { return float(sweep_.stopTime()); }
    /// Shortens the sweep to this fraction. Returns whether that shortened it.
    bool stopAt(float time);
    /// Moves the body to the pose where it is stopped. Returns whether it is stopped.
    bool apply() const;
    /// Takes back the speed that forces have added to a stopped body in the rest of a step of this length, in which it
    /// has not moved. Otherwise a body that is stopped again and again falls faster without falling.
    void endForces(float seconds) const;

  private:
    btCollisionObject& object_;
    btRigidBody* body_;
    Sweep sweep_;
};

}  // namespace bilayer::bullet::detail
