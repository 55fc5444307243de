// SPDX-License-Identifier: Apache-2.0
// How far from a body contacts are searched for if the margin is wider than the body's band.
// Tested by tests/collider/collide.cpp through collide().
#pragma once

#include <bilayer/collider/contact.h>

#include <vector>

#include "collider/field/layout/interpolant.h"

namespace bilayer::detail {

/// Which surface points can be in contact.
enum class ContactRange {
    margin,  ///< all within the margin: points outside the band search for the closest point of the surface
    band,    ///< those in the band only: points that move into it from outside have speculative contacts
};

/// Whether contacts up to a margin [m] are searched for beyond the band of a body.
inline bool reachesBeyondBand(const Placed& body, float margin, ContactRange range) {
    const Field& field = body.collider.field();
    return range == ContactRange::margin &&
           margin / body.scale > surelyInBand(field.exteriorWidth(), field.voxelSize());
}

/// The contacts of two bodies as collide() finds them, in this range. Steps of a simulation need no more than the band:
/// points that move into it have speculative contacts. ContactOptions::exact searches beyond the band in any case.
ContactReport collideWithin(ContactRange range, const Placed& a, const Placed& b, const ContactOptions& options,
                            std::vector<Contact>& contacts, ContactCache* cache = nullptr);

}  // namespace bilayer::detail
