// The sweep of an object over a step that has ended; internal.
// Tested by tests/bullet/continuous_collision.cpp.
#pragma once

#include <BulletDynamics/Dynamics/btRigidBody.h>

namespace bilayer::bullet::detail {

/// The object as a body, if it is an active dynamic body of the world; null otherwise.
btRigidBody* activeDynamicBody(btCollisionObject& object);

/// The sweep of an object over a step that has ended: its motion from the start to the end of the step.
class BodySweep {
  public:
    BodySweep(btCollisionObject& object, float seconds);

    const btCollisionObject& object() const { return object_; }
    float turn() const { return turn_; }

    /// Its transform after this fraction of the step [0..1].
    btTransform at(float time) const;

    /// Radius of a sphere about the object's origin that contains the object.
    float radius() const;
    float longest() const { return way_.length() + radius() * turn_; }
    /// Upper bound of the displacement of its points in the frame of another object.
    float longest(const BodySweep& other) const;
    /// Bounding box of the whole sweep.
    void box(btVector3& lower, btVector3& upper) const;

    btRigidBody* body() const { return body_; }
    /// The fraction of the step at which it is held; 1: not held.
    float part() const { return part_; }
    /// Shortens the sweep to this fraction. Returns whether that shortened it.
    bool holdAt(float part);
    /// Moves the body to the pose where it is held. Returns whether it is held.
    bool apply() const;

  private:
    btCollisionObject& object_;
    btRigidBody* body_ = nullptr;
    btTransform end_;
    btVector3 start_, way_{0, 0, 0}, axis_{1, 0, 0};
    btQuaternion orientation_;  ///< at the end
    float turn_ = 0, part_ = 1;
};

}  // namespace bilayer::bullet::detail
