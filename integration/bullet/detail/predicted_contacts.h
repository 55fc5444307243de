// SPDX-License-Identifier: Apache-2.0
// Predicted contacts of rotating bodies.
#pragma once

#include <bilayer/collider/contact.h>
#include <optional>

#include "integration/bullet/detail/manifolds.h"
#include "integration/bullet/detail/pair_contacts.h"
#include "integration/bullet/detail/velocity.h"

namespace bilayer::bullet::detail {

using namespace bilayer::detail;

/// Predicts contacts at the end of the step. Bullet's solver assumes straight paths in a step, and applies forces where
/// the bodies are at its beginning. The points of a wheel ahead of the lowest one come down in the step, and would
/// penetrate the ground on straight paths. They then bear the wheel's weight and brake it: at 60 steps a second, a
/// sphere of 0.1 m that rolls at 0.3 m/s loses half of its speed in a second. So the contact of a point that rotates
/// with its body is handed over as it will be at the end of the step.
class PredictedContacts {
  public:
    /// The bodies must outlive this object.
    PredictedContacts(const Side& a, const Side& b, const Continuity& continuity);

    /// The predicted contact. Nothing if the contact touches already, or its rotation is negligible.
    std::optional<PredictedContact> predict(const Contact& contact) const;

  private:
    struct MovingSide {
        const Side& side;
        Velocity velocity;
    };
    float maxSeconds(const MovingSide& body, const btVector3& place) const;

    MovingSide a_, b_;
    const Continuity& continuity_;
};

}  // namespace bilayer::bullet::detail
