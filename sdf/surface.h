// The mesh of an isosurface, by OpenVDB.
#pragma once

#include <bilayer/sdf/level_set.h>
#include <bilayer/sdf/mesh.h>

namespace bilayer {

struct SurfaceOptions {
    float isovalue = 0;    ///< distance of the extracted surface [m]; within the band
    float adaptivity = 0;  ///< 0: uniform, 1: as few triangles as flat regions allow
};

/// The isosurface as a mesh with outward normals; empty if the surface does not exist.
/// Throws std::invalid_argument for an isovalue outside the band or an adaptivity outside 0..1.
Mesh surface(const LevelSet& levelSet, const SurfaceOptions& options = {});

}  // namespace bilayer
