// SPDX-License-Identifier: Apache-2.0
// The contacts of a patch that small motions of the bodies meet first.
// Tested by tests/collider/first_contacts.cpp and contact_reduction.cpp through reduce().
#pragma once

#include <bilayer/collider/contact.h>

#include <cstdint>
#include <vector>

#include "collider/contact/reduction/contact_groups.h"

namespace bilayer::detail {

/// Tolerance of the choice [fractions of the extent]. A contact that touches earlier than the kept ones by less than
/// this need not be kept, and contacts of the last step are kept again. Otherwise rounding would decide which of
/// several comes first, and bodies would jitter with each change.
inline constexpr float reductionTolerance = 1e-3f;
/// The same for the deepest contact, which a motion along the normal touches first. If the kept contacts are less deep,
/// the bodies are pushed apart by the difference as soon as the deepest one is chosen again. A body that rocks on a
/// crest would gain this height in each cycle.
inline constexpr float normalMotionTolerance = reductionTolerance / 16;

struct FirstContacts {
    std::vector<std::uint32_t> kept;  ///< indices into the group
    /// The maximum depth that motions in between reach before the kept contacts touch [m].
    float reductionError = 0;
};

/// Chooses the contacts of a group that some small motion of the bodies meets first. A contact of the last step stays
/// while some motion meets it first within the tolerance: contacts that bear a load must not come and go.
/// @param last      the contacts of the last step
/// @param rotation  angle by which the bodies rotate relative to each other in the step [rad]
FirstContacts firstContacts(const std::vector<Contact>& contacts, const ContactGroup& group, const LastContacts& last,
                            float rotation);

}  // namespace bilayer::detail
