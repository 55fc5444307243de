// SPDX-License-Identifier: Apache-2.0
// A handle spins freely about its intermediate axis and flips over repeatedly (the Dzhanibekov effect, seen in orbit).
// Nothing acts on it, so its angular momentum must be conserved.
#pragma once

#include "demos/shared/outcome.h"

namespace bilayer::demo {

struct SpinOptions {
    float seconds = 60;
    float spin = 6;              ///< about the intermediate axis [rad/s]
    float perturbation = 0.05f;  ///< initial perturbation about the other two axes [rad/s]
    float voxelSize = 0.002f;    ///< [m]
};

/// Criteria: the angular momentum vector drifts by less than 1 % per minute. The handle flips over. Mass and inertia of
/// the field are within 0.5 % of the mesh's.
Outcome spin(const SpinOptions& options);

}  // namespace bilayer::demo
