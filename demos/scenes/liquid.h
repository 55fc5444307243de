// A liquid bunny falls into a tank, around a solid knot that turns: a mesh becomes liquid by fluid::seed, another one
// an obstacle by fluid::solid, and OpenVDB's own tools do the rest (shared/water.h).
#pragma once

#include "demos/shared/outcome.h"

namespace bilayer::demo {

struct LiquidOptions {
    int resolution = 64;       ///< cells along the tank's longest side, a metre
    float seconds = 3.5;       ///< how long
    float turns = 0.25;        ///< of the knot, a second
    float restoring = 0.1f;    ///< WaterOptions::restoring [s]
    int framesPerSecond = 20;  ///< of the recording; volumes are measured at each
};

/// Criteria: the volume, at any time and in the end; what of the liquid is in the knot, by its mesh, and beyond the
/// walls; the divergence that the pressure leaves.
Outcome liquid(const LiquidOptions& options);

}  // namespace bilayer::demo
