// SPDX-License-Identifier: Apache-2.0
// The standard deformation test for level sets: a deformation flow stretches a body into a thin film and, reversed,
// restores it. After R. J. LeVeque, "High-resolution conservative algorithms for advection in incompressible flow",
// SIAM J. Numer. Anal. 33 (1996), and D. Enright, R. Fedkiw, J. Ferziger, I. Mitchell, "A hybrid particle level set
// method for improved interface capturing", J. Comput. Phys. 183 (2002), section 4.
#pragma once

#include "demos/shared/outcome.h"

namespace bilayer::demo {

struct EnrightOptions {
    int resolution = 100;      ///< voxels along the unit cube
    int framesPerSecond = 20;  ///< of the recording; volumes are measured in each frame
};

/// Advects a sphere and a bunny, seeded by fluid::seed and by OpenVDB, with openvdb::tools::LevelSetAdvection.
/// Criteria: the final volume loss with our seeding does not exceed that with OpenVDB's, except for noise. All results
/// are level sets by openvdb::tools::checkLevelSet, except for gradients.
Outcome enright(const EnrightOptions& options);

}  // namespace bilayer::demo
