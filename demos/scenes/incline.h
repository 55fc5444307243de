// SPDX-License-Identifier: Apache-2.0
// Blocks on inclines, each with a different friction: the shortest scene, and the one to copy. After E. Guendelman, R.
// Bridson, R. Fedkiw, "Nonconvex rigid bodies with stacking", ACM TOG 22 (2003). Theory predicts which blocks stick and
// how fast the others slide.
#pragma once

#include <vector>

#include "demos/shared/outcome.h"

namespace bilayer::demo {

struct InclineOptions {
    std::vector<float> slopes{10, 20, 30, 40};  ///< one incline per slope [degrees]
    /// One block per value: the coefficient of friction divided by the tangent of the slope. In theory, a block slides
    /// below 1.
    std::vector<float> frictions{0, 0.25f, 0.5f, 0.75f, 0.9f, 0.975f, 1.025f, 1.1f, 1.5f};
    float seconds = 1.5f;
    float voxelSize = 0.02f;  ///< of all bodies [m]
};

/// Criteria: blocks below 0.98 slide, and those above 1.02 stick. Acceleration is g (sin - friction cos) within 2 %.
Outcome incline(const InclineOptions& options);

}  // namespace bilayer::demo
