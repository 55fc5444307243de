// SPDX-License-Identifier: Apache-2.0
// Pairs of every Bullet shape and a field, one resting on the other. Fields of a box, a ball and a ring, and a field
// scaled by Bullet, rest on each shape that has a flat top. Each shape rests on a field. The pairs cover both orders of
// creation, and static, kinematic and dynamic lower bodies.
#pragma once

#include <string>

#include "demos/shared/outcome.h"

namespace bilayer::demo {

struct PairsOptions {
    float scale = 1;     ///< of all lengths; at 1, bodies are about a metre wide
    int every = 1;       ///< uses only every n-th of all 188 pairs
    std::string only{};  ///< of these, only the ones with this text in their name, such as "hull on dynamic"
    float seconds = 2;   ///< up to scale 1; above, times the root of the scale, as falls take longer by it
    float stepsPerSecond = 240;
    int iterations = 50;  ///< of Bullet's solver; with 10, bodies on small bodies rock
};

/// Criteria: all bodies rest where formulas predict, to a tenth of a voxel in height and a tenth of a degree in tilt.
/// No penetration reaches a tenth of a voxel.
Outcome pairs(const PairsOptions& options);

}  // namespace bilayer::demo
