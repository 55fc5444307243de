// Nuts run down their bolts by gravity alone: a turn must take them down by a pitch, and friction that holds the nut in
// theory must hold it here. After Y. Narang and others, "Factory: fast contact for robotic assembly", RSS 2022.
#pragma once

#include <vector>

#include "demos/shared/outcome.h"

namespace bilayer::demo {

struct NutsOptions {
    int pairs = 16;
    std::vector<float> frictions{0, 0.01f, 0.05f, 0.1f};  ///< of the pairs in turn
    float turns = 10;                                     ///< the nuts that run make
    float seconds = 5;                                    ///< at most
    float clearance = 50e-6f;                             ///< of the threads [m], see shapes::Thread
    float stepsPerSecond = 480;
    int iterations = 100;       ///< of Bullet's solver
    float voxelSize = 0.3e-3f;  ///< [m]
};

/// Criteria: the advance of each turn is the thread's pitch within 1 %; nuts run that friction does not hold in theory,
/// and those that it holds stay; no overlap of half a voxel.
Outcome nuts(const NutsOptions& options);

}  // namespace bilayer::demo
