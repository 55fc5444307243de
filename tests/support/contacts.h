// Contact options for tests.
#pragma once

#include <bilayer/collider/contact.h>

namespace bilayer::test {

/// Contacts of all points within the margin, without the normal filter.
inline ContactOptions unfiltered(float margin, bool exact = false) {
    return {
        .margin = margin, .exact = exact, .minNormalCosine = -2, .minNormalCosineApart = -2, .keepsObliqueEdges = true};
}

}  // namespace bilayer::test
