// The deformation that level sets are judged by: a swirl stretches a body into a sheet and, turned around, puts it
// back. After R. J. LeVeque, "High-resolution conservative algorithms for advection in incompressible flow", SIAM J.
// Numer. Anal. 33 (1996), and D. Enright, R. Fedkiw, J. Ferziger, I. Mitchell, "A hybrid particle level set method for
// improved interface capturing", J. Comput. Phys. 183 (2002), section 4.
#pragma once

#include "demos/shared/outcome.h"

namespace bilayer::demo {

struct EnrightOptions {
    int resolution = 100;      ///< voxels along the unit cube
    int framesPerSecond = 20;  ///< of the recording; volumes are measured at each
};

/// A sphere and a bunny, seeded by fluid::seed and by OpenVDB, are carried by openvdb::tools::LevelSetAdvection.
/// Criteria: what is lost in the end is no more with our seeding than with OpenVDB's, but for noise; all are level sets
/// in the end by openvdb::tools::checkLevelSet, but for slopes.
Outcome enright(const EnrightOptions& options);

}  // namespace bilayer::demo
