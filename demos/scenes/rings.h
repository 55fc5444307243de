// SPDX-License-Identifier: Apache-2.0
// A thousand rings fall down poles, each around its pole. After E. Guendelman, R. Bridson, R. Fedkiw, "Nonconvex rigid
// bodies with stacking", ACM TOG 22 (2003), figure 1.
#pragma once

#include <cstdint>

#include "demos/shared/outcome.h"

namespace bilayer::demo {

struct RingsOptions {
    int rows = 5;  ///< poles form a square of rows x rows
    int ringsPerPole = 40;
    float seconds = 20;  ///< max duration; ends when all rings sleep
    float stepsPerSecond = 240;
    /// Iterations of Bullet's solver: a stack needs about as many as its height in bodies. With 10, a stack of 40
    /// jitters at 2 to 3 cm/s, both with these rings and with rings of Bullet's own capsules; with 50 it sleeps. A
    /// thousand touching rings sleep only after none has rotated faster than its threshold for two seconds, which needs
    /// more.
    int iterations = 200;
    float voxelSize = 0.006f;  ///< of the rings [m]
    std::uint32_t seed = 7;    ///< of the initial poses of the rings
};

/// Criteria: no ring leaves its pole except over the top. No penetration reaches one voxel. All rings fall asleep in
/// time.
Outcome rings(const RingsOptions& options);

}  // namespace bilayer::demo
