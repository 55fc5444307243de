// SPDX-License-Identifier: Apache-2.0
// Contacts whose numbers are finite; internal.
// Tested by tests/collider/extremes.cpp through collide().
#pragma once

#include <bilayer/collider/contact.h>

#include <algorithm>
#include <cstddef>
#include <vector>

namespace bilayer::detail {

/// Removes contacts from index `first` on if any of their numbers is not finite, as may happen to bodies that are too
/// large, too small or too far away for floats.
inline void removeNonFinite(std::vector<Contact>& contacts, std::size_t first) {
    const auto isInfinite = [](const Contact& c) {
        // a product with zero is no number if the factor is not finite
        return 0 * c.position.x + 0 * c.position.y + 0 * c.position.z + 0 * c.normal.x + 0 * c.normal.y +
                   0 * c.normal.z + 0 * c.distance + 0 * c.approach + 0 * c.roundingRadius !=
               0;
    };
    contacts.erase(std::remove_if(contacts.begin() + std::ptrdiff_t(first), contacts.end(), isInfinite),
                   contacts.end());
}

}  // namespace bilayer::detail
