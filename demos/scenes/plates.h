// SPDX-License-Identifier: Apache-2.0
// Balls shot at thin plates at 60 steps per second, with one lane per speed and thickness. In one step, the fastest
// travels three hundred times the path through its plate.
#pragma once

#include <vector>

#include "demos/shared/outcome.h"

namespace bilayer::demo {

struct PlatesOptions {
    std::vector<float> speeds{1, 3, 10, 30, 100, 300, 1000};  ///< [m/s]
    std::vector<float> thicknesses{1, 2, 4};                  ///< of the plates [voxels]
    std::vector<float> angles{0, 45};  ///< lanes with different fractions of a step at the time of impact
    int phases = 4;                    ///< lanes that differ in the part of a step at which the ball arrives
    float restitution = 0.5f;
    float stepsPerSecond = 60;
    float voxelSize = 0.01f;  ///< [m]
};

/// Criteria: no ball tunnels through its plate, no pose is NaN, and no ball is faster after the impact than before.
Outcome plates(const PlatesOptions& options);

}  // namespace bilayer::demo
