// Every shape of Bullet's and a field, one on the other: fields of a box, a ball and a ring, and one scaled by Bullet,
// lie on each shape that has a flat top, and each shape lies on a field, whichever of the two was there first and
// whether the lower one is static, kinematic, or moves itself.
#pragma once

#include <string>

#include "demos/shared/outcome.h"

namespace bilayer::demo {

struct PairsOptions {
    float scale = 1;     ///< of everything: bodies are about a metre wide at 1
    int every = 1;       ///< only every so many of all 188 pairs are laid
    std::string only{};  ///< and of these only those with this in their name, as in "hull on dynamic"
    float seconds = 2;   ///< up to scale 1; above, times the root of the scale: that is how much longer a fall takes
    float stepsPerSecond = 240;
    int iterations = 50;  ///< of Bullet's solver: with 10, what lies on small bodies rocks
};

/// Criteria: all rest where formulas say, to a tenth of a voxel in height and of a degree in tilt; none overlaps what
/// it lies on by a tenth of a voxel.
Outcome pairs(const PairsOptions& options);

}  // namespace bilayer::demo
