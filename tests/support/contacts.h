// Contacts as the tests ask for them.
#pragma once

#include <bilayer/collider/contact.h>

namespace bilayer::test {

/// Contacts of all points that are near enough, whatever their normals.
inline ContactOptions unfiltered(float margin, bool exact = false) {
    return {
        .margin = margin, .exact = exact, .minNormalCosine = -2, .minNormalCosineApart = -2, .keepsObliqueEdges = true};
}

}  // namespace bilayer::test
