// Blocks on inclines, each with another friction: the shortest scene, and the one to copy. After E. Guendelman, R.
// Bridson, R. Fedkiw, "Nonconvex rigid bodies with stacking", ACM TOG 22 (2003): theory tells which blocks stick, and
// how fast the others slide.
#pragma once

#include <vector>

#include "demos/shared/outcome.h"

namespace bilayer::demo {

struct InclineOptions {
    std::vector<float> slopes{10, 20, 30, 40};  ///< one incline each [degrees]
    /// One block each: coefficient of friction in parts of the slope's tangent, at which theory lets a block slide.
    std::vector<float> frictions{0, 0.25f, 0.5f, 0.75f, 0.9f, 0.975f, 1.025f, 1.1f, 1.5f};
    float seconds = 1.5f;
    float voxelSize = 0.02f;  ///< of all bodies [m]
};

/// Criteria: blocks below 0.98 slide, those above 1.02 stick; acceleration g (sin - friction cos) within 2 %.
Outcome incline(const InclineOptions& options);

}  // namespace bilayer::demo
