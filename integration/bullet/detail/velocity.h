// How the objects of a world move.
#pragma once

#include <BulletCollision/CollisionDispatch/btCollisionObject.h>

namespace bilayer::bullet::detail {

/// The motion of a rigid body, or of a link of a multibody, about its centre of mass.
struct Velocity {
    btVector3 centre{0, 0, 0};   ///< of mass, in the world [m]
    btVector3 linear{0, 0, 0};   ///< of the centre [m/s]
    btVector3 angular{0, 0, 0};  ///< [rad/s]

    /// Of the place of the body that is at `point` in the world [m/s].
    btVector3 at(const btVector3& point) const { return linear + angular.cross(point - centre); }
};

/// What an object does as its world has left it; nothing for what is static or no body. Kinematic bodies move as their
/// poses of the last steps say.
Velocity velocityOf(const btCollisionObject& object);

/// What the forces on a rigid body so far do to its centre in a step [m/s^2]; 0 for all else.
btVector3 accelerationOf(const btCollisionObject& object);

}  // namespace bilayer::bullet::detail
