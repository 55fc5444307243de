// SPDX-License-Identifier: Apache-2.0
// Position and orientation of a rigid body.
// Tested by tests/collider/collide.cpp.
#pragma once

#include <glm/gtc/quaternion.hpp>
#include <glm/vec3.hpp>

namespace bilayer {

/// A rigid transform: body coordinates x map to rotation * x + position in the world.
struct Pose {
    glm::vec3 position{0};           ///< [m]
    glm::quat rotation{1, 0, 0, 0};  ///< unit quaternion, to 1e-3; w, x, y, z

    /// A point of the body in world coordinates.
    glm::vec3 toWorld(const glm::vec3& point) const { return rotation * point + position; }
    /// A point of the world in the body's coordinates.
    glm::vec3 toBody(const glm::vec3& point) const { return glm::conjugate(rotation) * (point - position); }
};

/// The pose of b in the frame of a: inverse(a) * b.
inline Pose relative(const Pose& a, const Pose& b) {
    const glm::quat inverse = glm::conjugate(a.rotation);
    return {inverse * (b.position - a.position), inverse * b.rotation};
}

}  // namespace bilayer
