// SPDX-License-Identifier: Apache-2.0
// A liquid bunny falls into a tank, around a solid knot that rotates. fluid::seed turns one mesh into liquid,
// fluid::solid turns another into an obstacle, and OpenVDB's tools do the rest (shared/water.h).
#pragma once

#include "demos/shared/outcome.h"

namespace bilayer::demo {

struct LiquidOptions {
    int resolution = 64;       ///< cells along the tank's longest side, which is one metre
    float seconds = 3.5;       ///< duration [s]
    float turns = 0.25;        ///< revolutions of the knot per second
    float restoring = 0.1f;    ///< WaterOptions::restoring [s]
    int framesPerSecond = 20;  ///< of the recording; volumes are measured in each frame
};

/// Criteria: the volume error at any time and at the end; the liquid inside the knot, measured by its mesh, and beyond
/// the walls; the residual divergence of the pressure solve.
Outcome liquid(const LiquidOptions& options);

}  // namespace bilayer::demo
