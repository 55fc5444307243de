// SPDX-License-Identifier: Apache-2.0
// The accumulated rotation of bodies, including full revolutions.
#pragma once

#include <cmath>
#include <glm/gtc/constants.hpp>
#include <glm/gtc/quaternion.hpp>

namespace bilayer::demo {

/// The accumulated rotation angle of a body about a world axis through its centre, updated each step. The body must
/// rotate by less than half a revolution per step and tilt only slightly.
class AccumulatedRotation {
  public:
    explicit AccumulatedRotation(const glm::quat& start, const glm::dvec3& axis = {0, 0, 1})
        : axis_(axis), last_(start) {}

    void follow(const glm::quat& now) {
        const glm::dquat step = glm::dquat(now) * glm::conjugate(last_);
        const double angle = 2 * std::atan2(glm::dot(glm::dvec3(step.x, step.y, step.z), axis_), step.w);
        angle_ += std::remainder(angle, 2 * glm::pi<double>());
        last_ = glm::dquat(now);
    }

    double angle() const { return angle_; }  ///< since the start [rad]
    double revolutions() const { return angle_ / (2 * glm::pi<double>()); }

  private:
    glm::dvec3 axis_;
    glm::dquat last_;
    double angle_ = 0;
};

}  // namespace bilayer::demo
