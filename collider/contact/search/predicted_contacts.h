// SPDX-License-Identifier: Apache-2.0
// Predicted contacts of rotating bodies.
// Tested by tests/bullet/predicted_contacts.cpp through bullet::Shape.
#pragma once

#include <bilayer/collider/contact.h>

#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <optional>

namespace bilayer::detail {

/// A body in a step of a solver, with its current velocity.
struct SteppedBody {
    glm::vec3 centre{0};          ///< of mass [m]
    glm::vec3 linear{0};          ///< of the centre [m/s]
    glm::vec3 angular{0};         ///< [rad/s]
    float seconds = 0;            ///< until the end of the step
    std::optional<Placed> field;  ///< none: near a contact, its surface is a plane

    /// Velocity of the body's point at a place [m/s].
    glm::vec3 velocityAt(const glm::vec3& place) const { return linear + glm::cross(angular, place - centre); }
};

/// The end-of-step contact of rotating bodies. Its coordinates move with the centre of each body.
struct PredictedContact {
    glm::vec3 onA, onB;  ///< contact points on the bodies [m]
    glm::vec3 normal;    ///< from B to A
    float distance;      ///< remaining separation, without the displacements that the solver accounts for [m]
};

/// Predicts contacts as they will be at the end of the step, for points that rotate with their body. Solvers assume
/// that points move straight, and apply forces where the bodies are at the beginning of the step. On a rolling wheel,
/// the points ahead of the lowest one move down. On a straight path they would penetrate the ground, so the solver lets
/// them bear the weight, which brakes the wheel: at 60 steps a second, a sphere of 0.1 m that rolls at 0.3 m/s loses
/// half of its speed in a second.
class PredictedContacts {
  public:
    /// @param a, b           must outlive this object
    /// @param sameWithin     contacts closer than this are one to the solver; the unit of tolerances [m]
    /// @param isSpeculative  whether contacts are known for the whole motion, or only up to a margin
    PredictedContacts(const SteppedBody& a, const SteppedBody& b, float sameWithin, bool isSpeculative)
        : a_(a), b_(b), sameWithin_(sameWithin), isSpeculative_(isSpeculative) {}

    /// The predicted contact. Nothing if the contact touches already, or its rotation is negligible.
    std::optional<PredictedContact> predict(const Contact& contact) const;

  private:
    float maxSeconds(const SteppedBody& body, const glm::vec3& place) const;

    const SteppedBody &a_, &b_;
    float sameWithin_;
    bool isSpeculative_;
};

}  // namespace bilayer::detail
