// The way of an object through a step that has come to its end; internal.
#pragma once

#include <BulletDynamics/Dynamics/btRigidBody.h>

namespace bilayer::bullet::detail {

/// An object as a body that the world moves and that is awake; null for others.
btRigidBody* activeDynamicBody(btCollisionObject& object);

/// The way of an object through a step that has come to its end.
class BodySweep {
  public:
    BodySweep(btCollisionObject& object, float seconds);

    const btCollisionObject& object() const { return object_; }
    float turn() const { return turn_; }

    /// Where it is after a part of the step [0..1].
    btTransform at(float time) const;

    /// A ball around everything about the object's origin.
    float radius() const;
    float longest() const { return way_.length() + radius() * turn_; }
    /// How far any of its points goes as another object sees it, at most.
    float longest(const BodySweep& other) const;
    /// Around all of its way.
    void box(btVector3& lower, btVector3& upper) const;

    btRigidBody* body() const { return body_; }
    /// The part of the step after which it goes no farther.
    float part() const { return part_; }
    /// Whether it goes less far now.
    bool holdAt(float part);
    /// Puts the body where it is held; whether it is.
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
