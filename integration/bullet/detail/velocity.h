// SPDX-License-Identifier: Apache-2.0
// Velocities of the objects of a world.
// Tested by tests/bullet/multibodies.cpp.
#pragma once

#include <BulletCollision/CollisionDispatch/btCollisionObject.h>

namespace bilayer::bullet::detail {

/// The velocity of a rigid body, or of a link of a multibody, about its centre of mass.
struct Velocity {
    btVector3 centre{0, 0, 0};   ///< centre of mass, in the world [m]
    btVector3 linear{0, 0, 0};   ///< of the centre [m/s]
    btVector3 angular{0, 0, 0};  ///< [rad/s]

    /// Velocity of the body's point that is at `point` in the world [m/s].
    btVector3 at(const btVector3& point) const { return linear + angular.cross(point - centre); }
};

/// The current velocity of an object. Zero for static objects and objects that are not bodies. Kinematic
/// bodies move as given by their poses of the last steps.
Velocity velocityOf(const btCollisionObject& object);

/// The acceleration of a rigid body's centre by the forces applied so far in this step [m/s^2]; 0 for all other
/// objects.
btVector3 accelerationOf(const btCollisionObject& object);

}  // namespace bilayer::bullet::detail
