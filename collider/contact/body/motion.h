// SPDX-License-Identifier: Apache-2.0
// The relative motion of two bodies.
// Tested by tests/collider/collide.cpp through collide().
#pragma once

#include <glm/geometric.hpp>

#include <bilayer/collider/contact.h>
#include <bilayer/collider/pose.h>

namespace bilayer::detail {

/// The motion of a body's points relative to another body, in the other one's coordinates [m].
class RelativeMotion {
  public:
    RelativeMotion(const Pose& body, const Motion& motion, const Pose& other, const Motion& otherMotion) {
        const glm::quat into = glm::conjugate(other.rotation);
        displacement_ = into * (motion.displacement - otherMotion.displacement +
                                glm::cross(motion.rotation, other.position - body.position));
        rotation_ = into * (motion.rotation - otherMotion.rotation);
    }

    /// The displacement of the body's point at `point`.
    glm::vec3 of(const glm::vec3& point) const { return displacement_ + glm::cross(rotation_, point); }

    /// The body's rotation relative to the other one [rad].
    const glm::vec3& rotation() const { return rotation_; }

    /// An upper bound of the displacements of the points in a sphere.
    float maxDisplacement(const glm::vec3& centre, float radius) const {
        return glm::length(of(centre)) + radius * glm::length(rotation_);
    }

  private:
    glm::vec3 displacement_, rotation_;
};

}  // namespace bilayer::detail
