// SPDX-License-Identifier: Apache-2.0
// The motion of a body through a step.
// Tested by tests/collider/time_of_impact.cpp through timeOfImpact().
#pragma once

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>

#include <bilayer/collider/contact.h>
#include <bilayer/collider/pose.h>

namespace bilayer::detail {

/// The motion of a body through a step: its centre moves at a constant velocity, and it rotates about the centre at a
/// constant angular velocity, until it is stopped. In double precision, so that it is exact at both ends.
class Sweep {
  public:
    /// @param centre  of the rotation; the coordinates of the body begin there
    /// @param motion  of the centre
    Sweep(const Pose& centre, const Motion& motion)
        : start_(centre.position),
          displacement_(motion.displacement),
          rotation_(motion.rotation),
          orientation_(glm::normalize(glm::dquat(centre.rotation))) {}

    /// The motion from one pose to another, by a rotation of less than pi.
    static Sweep between(const Pose& start, const Pose& end) {
        Sweep sweep(start, {});
        sweep.displacement_ = glm::dvec3(end.position) - sweep.start_;
        glm::dquat rotation = glm::normalize(glm::dquat(end.rotation)) * glm::conjugate(sweep.orientation_);
        if (rotation.w < 0) rotation = -rotation;
        const glm::dvec3 axis(rotation.x, rotation.y, rotation.z);
        const double sine = glm::length(axis);
        if (sine > 0) sweep.rotation_ = 2 * std::atan2(sine, rotation.w) / sine * axis;
        return sweep;
    }

    /// The pose after this fraction of the step [0..1].
    Pose at(double time) const {
        const double elapsed = std::min(time, stopTime_);
        return {glm::vec3(start_ + elapsed * displacement_), glm::quat(rotated(elapsed))};
    }

    const glm::dvec3& start() const { return start_; }
    const glm::dvec3& displacement() const { return displacement_; }
    /// Angle of the rotation [rad].
    double angle() const { return glm::length(rotation_); }
    /// Upper bound of the displacement of the points within a distance from the centre.
    double maxDisplacement(double radius) const { return glm::length(displacement_) + radius * angle(); }

    /// The fraction of the step at which the body is stopped; 1: not stopped.
    double stopTime() const { return stopTime_; }
    void stopAt(double time) { stopTime_ = time; }

  private:
    glm::dquat rotated(double fraction) const {
        const double whole = angle();
        if (!(whole > 0)) return orientation_;
        return glm::normalize(glm::angleAxis(fraction * whole, rotation_ / whole) * orientation_);
    }

    glm::dvec3 start_, displacement_, rotation_;
    glm::dquat orientation_;
    double stopTime_ = 1;
};

/// The displacement of A as seen from B [m].
inline glm::vec3 relativeDisplacement(const Sweep& a, const Sweep& b) {
    return glm::vec3(a.displacement() - b.displacement());
}

/// An upper bound of how far a point of one body approaches a point of another in their sweeps.
inline double maxApproach(const Sweep& a, double radiusOfA, const Sweep& b, double radiusOfB) {
    return glm::distance(a.displacement(), b.displacement()) + radiusOfA * a.angle() + radiusOfB * b.angle();
}

}  // namespace bilayer::detail
