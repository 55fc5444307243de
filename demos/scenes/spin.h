// A handle that spins freely about its middle axis, and turns over again and again (the effect that V. Dzhanibekov saw
// in orbit): nothing acts on it, so its angular momentum must stay what it is.
#pragma once

#include "demos/shared/outcome.h"

namespace bilayer::demo {

struct SpinOptions {
    float seconds = 60;
    float spin = 6;            ///< about the middle axis [rad/s]
    float nudge = 0.05f;       ///< about the other two [rad/s]
    float voxelSize = 0.002f;  ///< [m]
};

/// Criteria: angular momentum drifts less than 1 % a minute, as a vector; the handle turns over; mass and inertia by
/// the field are within 0.5 % of the mesh's.
Outcome spin(const SpinOptions& options);

}  // namespace bilayer::demo
