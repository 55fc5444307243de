// Balls shot at thin plates, one lane for each speed and thickness, at 60 steps a second: the fastest would pass its
// plate three hundred times over in one step.
#pragma once

#include <vector>

#include "demos/shared/outcome.h"

namespace bilayer::demo {

struct PlatesOptions {
    std::vector<float> speeds{1, 3, 10, 30, 100, 300, 1000};  ///< [m/s]
    std::vector<float> thicknesses{1, 2, 4};                  ///< of the plates [voxels]
    std::vector<float> angles{0, 45};                         ///< from the plate's normal [degrees]
    int phases = 4;  ///< lanes that differ in the part of a step at which the ball arrives
    float restitution = 0.5f;
    float stepsPerSecond = 60;
    float voxelSize = 0.01f;  ///< [m]
};

/// Criteria: no ball goes through its plate, none is nowhere (NaN), none is faster after the impact than before.
Outcome plates(const PlatesOptions& options);

}  // namespace bilayer::demo
