// A thousand rings fall down poles, each with its pole through it. After E. Guendelman, R. Bridson, R. Fedkiw,
// "Nonconvex rigid bodies with stacking", ACM TOG 22 (2003), figure 1.
#pragma once

#include <cstdint>

#include "demos/shared/outcome.h"

namespace bilayer::demo {

struct RingsOptions {
    int rows = 5;  ///< poles stand in a square of rows x rows
    int ringsPerPole = 40;
    float seconds = 20;  ///< at most; it ends when all rings sleep
    float stepsPerSecond = 240;
    /// Of Bullet's solver: a stack takes about as many as it is high. With 10, one of 40 trembles at 2 to 3 cm/s, of
    /// these rings as of rings made of Bullet's own capsules; with 50 it sleeps. A thousand that touch each other sleep
    /// only when none has turned faster than its threshold for two seconds, which takes more.
    int iterations = 200;
    float voxelSize = 0.006f;  ///< of the rings [m]
    std::uint32_t seed = 7;    ///< of the rings' first poses
};

/// Criteria: no ring comes off its pole but over the top; no overlap as deep as a voxel; all sleep in time.
Outcome rings(const RingsOptions& options);

}  // namespace bilayer::demo
