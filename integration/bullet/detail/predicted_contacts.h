// Contacts of bodies that turn.
#pragma once

#include <bilayer/collider/contact.h>
#include <optional>

#include "integration/bullet/detail/manifolds.h"
#include "integration/bullet/detail/pair_contacts.h"
#include "integration/bullet/detail/velocity.h"

namespace bilayer::bullet::detail {

using namespace bilayer::detail;

/// Bullet's solver takes a step's ways for straight and lets forces act where bodies are at its beginning. A wheel's
/// points ahead of the lowest one, which come down in the step and would be in the ground if they went straight, then
/// bear its weight and brake it: at 60 steps a second a ball of 0.1 m that rolls at 0.3 m/s loses half of its
/// speed in a second. So the contact of a point that turns with its body is handed over as it is going to be at the
/// step's end.
class PredictedContacts {
  public:
    /// Of two bodies, which must outlive it.
    PredictedContacts(const Side& a, const Side& b, const Continuity& continuity);

    /// Nothing where a contact touches already, or does not turn, or by next to nothing.
    std::optional<PredictedContact> ahead(const Contact& contact) const;

  private:
    struct Body {
        const Side& side;
        Velocity velocity;
    };
    float maxSeconds(const Body& body, const btVector3& place) const;

    Body a_, b_;
    const Continuity& continuity_;
};

}  // namespace bilayer::bullet::detail
