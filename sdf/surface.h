// SPDX-License-Identifier: Apache-2.0
// Isosurface extraction by OpenVDB.
#pragma once

#include <bilayer/sdf/level_set.h>
#include <bilayer/sdf/mesh.h>

namespace bilayer {

/// Options of surface().
struct SurfaceOptions {
    float isovalue = 0;    ///< distance at the extracted surface [m]; must lie within the band
    float adaptivity = 0;  ///< 0: uniform mesh, 1: fewest triangles in flat regions
};

/// Extracts an isosurface as a mesh with outward normals; empty if there is no such surface. Throws
/// std::invalid_argument for an isovalue outside the band or an adaptivity outside 0..1.
Mesh surface(const LevelSet& levelSet, const SurfaceOptions& options = {});

}  // namespace bilayer
