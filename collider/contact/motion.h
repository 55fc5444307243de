// Where bodies go.
#pragma once

#include <glm/geometric.hpp>

#include <bilayer/collider/contact.h>
#include <bilayer/collider/pose.h>

namespace bilayer::detail {

/// How the points of a body move as another body sees them, in that one's coordinates [m].
class RelativeMotion {
  public:
    RelativeMotion(const Pose& body, const Motion& motion, const Pose& seenFrom, const Motion& its) {
        const glm::quat into = glm::conjugate(seenFrom.rotation);
        displacement_ = into * (motion.displacement - its.displacement +
                                glm::cross(motion.rotation, seenFrom.position - body.position));
        rotation_ = into * (motion.rotation - its.rotation);
    }

    /// Of the body's point that is at `point` now.
    glm::vec3 of(const glm::vec3& point) const { return displacement_ + glm::cross(rotation_, point); }

    /// Of the body, as the other one sees it [rad].
    const glm::vec3& rotation() const { return rotation_; }

    /// An upper bound of the displacement of points in a sphere.
    float longest(const glm::vec3& centre, float radius) const {
        return glm::length(of(centre)) + radius * glm::length(rotation_);
    }

  private:
    glm::vec3 displacement_, rotation_;
};

}  // namespace bilayer::detail
