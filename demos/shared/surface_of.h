// The surface of a level set of OpenVDB's as a mesh.
#pragma once

#include <openvdb/openvdb.h>

#include <bilayer/sdf/mesh.h>

namespace bilayer::demo {

/// As surface() in sdf/surface.h gives it; empty where the level set is.
Mesh surfaceOf(const openvdb::FloatGrid& grid, float adaptivity = 0);

}  // namespace bilayer::demo
