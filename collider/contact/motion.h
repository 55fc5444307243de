// Where bodies go.
#pragma once

#include <glm/geometric.hpp>

#include <bilayer/collider/contact.h>
#include <bilayer/collider/pose.h>

namespace bilayer::detail {

/// The ways of a body's points as another body sees them, in that one's coordinates [m].
class RelativeWays {
  public:
    RelativeWays(const Pose& body, const Motion& motion, const Pose& seenFrom, const Motion& its) {
        const glm::quat into = glm::conjugate(seenFrom.rotation);
        way_ = into * (motion.way - its.way + glm::cross(motion.turn, seenFrom.position - body.position));
        turn_ = into * (motion.turn - its.turn);
    }

    /// Of the body's point that is at `point` now.
    glm::vec3 of(const glm::vec3& point) const { return way_ + glm::cross(turn_, point); }

    /// Of the body, as the other one sees it [rad].
    const glm::vec3& turn() const { return turn_; }

    /// The longest way of a point in a sphere, at most.
    float longest(const glm::vec3& centre, float radius) const {
        return glm::length(of(centre)) + radius * glm::length(turn_);
    }

  private:
    glm::vec3 way_, turn_;
};

}  // namespace bilayer::detail
