// SPDX-License-Identifier: Apache-2.0
// Contact options for tests, and what they ask of contacts.
#pragma once

#include <algorithm>
#include <catch2/catch.hpp>
#include <limits>
#include <vector>

#include <bilayer/collider/contact.h>

namespace bilayer::test {

/// Contacts of all points within the margin, without the normal filter.
inline ContactOptions unfiltered(float margin, bool exact = false) {
    return {
        .margin = margin, .exact = exact, .minNormalCosine = -2, .minNormalCosineApart = -2, .keepsObliqueEdges = true};
}

/// The minimum separation; infinity without contacts.
inline float minDistance(const std::vector<Contact>& contacts) {
    float least = std::numeric_limits<float>::infinity();
    for (const Contact& contact : contacts) least = std::min(least, contact.distance);
    return least;
}

/// The contact of minimum separation. Fails the test without contacts.
inline const Contact& deepest(const std::vector<Contact>& contacts) {
    REQUIRE_FALSE(contacts.empty());
    return *std::min_element(contacts.begin(), contacts.end(),
                             [](const Contact& a, const Contact& b) { return a.distance < b.distance; });
}

}  // namespace bilayer::test
